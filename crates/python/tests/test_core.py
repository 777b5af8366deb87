"""The online algorithm in Python: samples, arrays and whole recordings agree; wrong inputs raise the command's message."""

import pydoc

import numpy as np
import pandas
import pytest
import stylet


def measured(two_gels):
    run = stylet.simulate(two_gels)
    frame = run.to_pandas()
    return run, frame[["time_s", "position_m", "force_n", "velocity_mps"]]


def test_step_run_and_enhance_agree(two_gels):
    run, data = measured(two_gels)
    arrays = stylet.Enhancer().run(**{c: data[c].to_numpy() for c in data})
    core, outs = stylet.Enhancer(), []
    for row in data.itertuples(index=False):
        outs.append(core.step(**row._asdict()))
    assert np.array_equal(arrays["enhanced_n"], [o.enhanced_n for o in outs])
    assert [stylet.STATES[s] for s in arrays["state"]] == [o.state for o in outs]
    whole = stylet.enhance(data)
    assert np.array_equal(whole.to_pandas()["enhanced_n"], arrays["enhanced_n"])
    assert [r["time_s"] for r in whole.ruptures] == run.ruptures_s
    assert len(whole.ruptures) >= 1 and len(whole.layers) >= 1


def test_an_enhancer_continues_and_resets(two_gels):
    _, data = measured(two_gels)
    columns = {c: data[c].to_numpy() for c in data}
    core = stylet.Enhancer()
    whole = core.run(**columns)["enhanced_n"]
    core.reset()
    half = len(data) // 2
    parts = [core.run(**{k: v[:half] for k, v in columns.items()}), core.run(**{k: v[half:] for k, v in columns.items()})]
    assert np.array_equal(whole, np.concatenate([p["enhanced_n"] for p in parts]))


def test_configurations_are_text_dicts_or_files(two_gels, tmp_path):
    text = "Enhance(model: KelvinVoigt, forgetting: 0.99)"
    (tmp_path / "e.ron").write_text(text)
    _, data = measured(two_gels)
    found = [
        stylet.enhance(data, config).arrays()["enhanced_n"]
        for config in (text, tmp_path / "e.ron", {"model": "KelvinVoigt", "forgetting": 0.99})
    ]
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


def test_wrong_input_is_an_exception_with_the_commands_sentence(two_gels):
    with pytest.raises(stylet.StyletError, match="forgetting.*must lie above 0 and be at most 1"):
        stylet.Enhancer("Enhance(forgetting: 1.5)")
    with pytest.raises(stylet.StyletError, match="unknown field `thicknes_m`.*did you mean `thickness_m`"):
        stylet.simulate(two_gels.replace("thickness_m", "thicknes_m", 1))
    with pytest.raises(ValueError, match="no column `force_n`"):
        stylet.enhance(pandas.DataFrame({"time_s": [0.0, 1.0], "position_m": [0.0, 1.0]}))
    with pytest.raises(stylet.StyletError, match="different lengths"):
        stylet.Enhancer().run(time_s=[0.0, 1.0], position_m=[0.0, 1.0], velocity_mps=[0.0], force_n=[0.0, 1.0])
    with pytest.raises(stylet.StyletError, match="missing.ron"):
        stylet.simulate("missing.ron")


def test_arguments_are_given_by_keyword_and_help_lists_them():
    for call in (stylet.Enhancer().step, stylet.Enhancer().enhanced, stylet.Enhancer().run):
        with pytest.raises(TypeError):
            call(0.0, 0.0, 0.0, 0.0)
    assert "step(self, *, time_s" in pydoc.render_doc(stylet.Enhancer, renderer=pydoc.plaintext)
