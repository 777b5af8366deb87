"""Promise: Python gives the bytes of the command."""

import stylet


def test_simulate_gives_the_files_of_run(command, scenarios, tmp_path, two_gels):
    (tmp_path / "two.ron").write_text(two_gels)
    command("run", "two.ron", "--seed", "7", "--out", "there", "--quiet", cwd=tmp_path)
    run = stylet.simulate(tmp_path / "two.ron", seed=7)
    for name, ours in [("score.json", run.score_json()), ("recording.csv", run.recording_csv())]:
        assert ours == (tmp_path / "there" / name).read_bytes(), name
    run.write(tmp_path / "here")
    for name in ["score.json", "recording.csv", "scenario.ron", "figure.svg"]:
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes(), name


def test_diagnose_gives_the_files_of_diagnose(command, tmp_path, two_gels):
    assumed = two_gels
    real = assumed.replace("robot: Replay", "effects: [CoulombFriction(c_n_per_m: 12.0)], robot: Replay")
    (tmp_path / "assumed.ron").write_text(assumed)
    for seed in (1, 2):
        (tmp_path / f"{seed}.csv").write_bytes(stylet.simulate(real, seed=seed).recording_csv())
    files = [tmp_path / "1.csv", tmp_path / "2.csv"]
    command("diagnose", "assumed.ron", "--data", *files, "--out", "there", "--quiet", cwd=tmp_path)
    found = stylet.diagnose(tmp_path / "assumed.ron", files, progress=False)
    assert found.json() == (tmp_path / "there" / "diagnosis.json").read_bytes()
    said, ours = (tmp_path / "there" / "extended.ron").read_text(), found.extended_ron()
    # The first line names the file as it was given.
    assert ours.split("\n", 1)[1] == said.split("\n", 1)[1]
    assert [c["effect"] for c in found.result["causes"]] == ["coulomb_friction"]
    assert "coulomb_friction" in set(found.causes["effect"])
    row = found.causes.set_index("parameter").loc["c_n_per_m"]
    assert row["low"] < 12.0 < row["high"]
    force = found.predict({k: v for k, v in stylet.read_csv(files[0]).items()})
    measured = stylet.read_csv(files[0])["force_n"]
    assert (((force - measured) ** 2).mean()) ** 0.5 < 2 * found.gain["floor_n"] + 0.02
    assert len(found.plot().lines) >= 2


def test_check_and_identify_give_the_files_of_the_commands(command, tmp_path, two_gels):
    (tmp_path / "assumed.ron").write_text(two_gels)
    for seed in (1, 2):
        (tmp_path / f"{seed}.csv").write_bytes(stylet.simulate(two_gels, seed=seed).recording_csv())
    files = [tmp_path / "1.csv", tmp_path / "2.csv"]
    command("check", "assumed.ron", "--data", *files, "--out", "check", "--quiet", cwd=tmp_path)
    checked = stylet.check(tmp_path / "assumed.ron", files)
    assert checked.json() == (tmp_path / "check" / "check.json").read_bytes()
    assert checked.usable and set(checked.items["light"]) <= {"good", "limited"}
    command("identify", "--data", *files, "--out", "phantom", "--quiet", cwd=tmp_path)
    found = stylet.identify(files, progress=False)
    assert found.json() == (tmp_path / "phantom" / "diagnosis.json").read_bytes()
    assert len(found.covariance) == len(found.parameters) and found.grade in "ABCD"
