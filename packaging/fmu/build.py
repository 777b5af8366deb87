"""Builds an FMU (FMI 2.0, co-simulation) over the C library: python build.py enhancer|tissue PREFIX OUT.fmu

PREFIX is an installation of the C library. The headers of FMI are those of the package fmpy."""

import ctypes
import datetime
import os
import subprocess
import sys
import tempfile
import uuid
import zipfile
from pathlib import Path
from xml.sax.saxutils import quoteattr

import fmpy

HERE = Path(__file__).resolve().parent
FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
# SI base units of the units that occur.
UNITS = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "N.s/m2": {"kg": 1, "m": -1, "s": -1},
    "1/h": None,
}


def default_config(prefix):
    """`StyletConfig` with the library's defaults, up to the field that is a parameter."""

    class Config(ctypes.Structure):
        _fields_ = [(name, ctypes.c_int32) for name in ("algorithm", "model", "contact_known")] + [
            ("surface_m", ctypes.c_double), ("false_alarms_per_hour", ctypes.c_double), ("further", ctypes.c_double * 7)]

    config = Config()
    ctypes.CDLL(str(prefix / "lib/libstylet.so")).stylet_default_config(ctypes.byref(config))
    return config


def real(name, causality, unit, start, description):
    return ("Real", name, causality, unit, start, description)


def integer(name, causality, start, description):
    return ("Integer", name, causality, None, start, description)


def enhancer_variables(prefix):
    config = default_config(prefix)
    return [
        real("position_m", "input", "m", 0.0, "tip position, positive into the tissue"),
        real("velocity_mps", "input", "m/s", 0.0, "tip velocity"),
        real("force_n", "input", "N", 0.0, "axial force, positive when it resists the insertion"),
        real("surface_m", "parameter", "m", config.surface_m, "position of the surface, for contact_known"),
        real("false_alarms_per_hour", "parameter", "1/h", config.false_alarms_per_hour, "accepted false alarms per hour of insertion"),
        real("enhanced_n", "output", "N", None, "measured force less the friction of the passed layers"),
        real("low_n", "output", "N", None, "lower end of the 95 % interval of the tip force; NaN where the algorithm provides none"),
        real("high_n", "output", "N", None, "upper end of that interval"),
        real("reconstructed_n", "output", "N", None, "force predicted before the sample"),
        real("stiffness_n_per_m", "output", "N/m", None, "stiffness of the active layer"),
        real("friction", "output", None, None, "friction of the active layer, N s/m2 (multi-layer) or N s/m (Kelvin-Voigt)"),
        real("cumulative_friction_ns_per_m", "output", "N.s/m", None, "cumulative friction of the passed layers"),
        real("contact_m", "output", "m", None, "position of the first contact; NaN before"),
        integer("algorithm", "parameter", config.algorithm, "0 Paper, 1 Literal, 2 Stylet"),
        integer("model", "parameter", config.model, "0 multi-layer, 1 Kelvin-Voigt"),
        integer("contact_known", "parameter", config.contact_known, "not 0: the surface is at surface_m; 0: contact is detected in the force"),
        integer("samples", "parameter", 16384, "samples of a layer that are stored, for Paper"),
        integer("state", "output", None, "state of the algorithm, a StyletState"),
        integer("ruptures", "output", None, "ruptures declared so far"),
    ]


def tissue_variables(_prefix):
    # Layers of scenarios/three_layers.ron; no further ones.
    layers = [(0.0282, 40.0, 9000.0, 0.0), (0.0377, 60.0, 12000.0, 2.2), (0.0322, 80.0, 16000.0, 0.0)] + [(0.0, 0.0, 0.0, 0.0)] * 5
    variables = [
        real("position_m", "input", "m", 0.0, "tip position, positive into the tissue"),
        real("velocity_mps", "input", "m/s", 0.0, "tip velocity"),
        real("surface_m", "parameter", "m", 0.0, "position of the first layer's front face"),
    ]
    for number, (thickness, stiffness, friction, puncture) in enumerate(layers, 1):
        variables += [
            real(f"layer_{number}_thickness_m", "parameter", "m", thickness, f"thickness of layer {number}; 0: there is none"),
            real(f"layer_{number}_stiffness_n_per_m", "parameter", "N/m", stiffness, f"stiffness of layer {number}"),
            real(f"layer_{number}_friction_ns_per_m2", "parameter", "N.s/m2", friction, f"friction of layer {number} per metre of needle"),
            real(f"layer_{number}_puncture_n", "parameter", "N", puncture, f"puncture force of layer {number}; 0: ruptures at its far face"),
        ]
    return variables + [
        real("force_n", "output", "N", None, "force at the needle's base, positive when it resists the insertion"),
        real("elastic_n", "output", "N", None, "elastic force of the active layer"),
        real("friction_n", "output", "N", None, "friction along the shaft"),
        real("tip_n", "output", "N", None, "force at the tip"),
        integer("active_layer", "output", None, "active layer, from 1"),
    ]


MODELS = {
    "enhancer": ("StyletEnhancer", enhancer_variables, "Online identification of layered tissue and force enhancement"),
    "tissue": ("StyletTissue", tissue_variables, "Force of layered tissue on a needle"),
}


def description(name, about, variables, version, guid):
    """modelDescription.xml."""
    def attributes(**given):
        return "".join(f" {key}={quoteattr(str(value))}" for key, value in given.items() if value is not None)

    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    lines.append("<fmiModelDescription" + attributes(
        fmiVersion="2.0", modelName=name, guid=guid, description=f"{about}. Research software, not a medical device.", version=version,
        license="MIT OR Apache-2.0", generationTool=f"Stylet {version}", variableNamingConvention="flat", generationDateAndTime=date()) + ">")
    lines.append("  <CoSimulation" + attributes(modelIdentifier=name, canHandleVariableCommunicationStepSize="true") + "/>")
    lines.append("  <UnitDefinitions>")
    for unit, base in UNITS.items():
        inside = f"<BaseUnit{attributes(**base)}/>" if base else f'<BaseUnit s="-1" factor="{1 / 3600!r}"/>'
        lines.append(f"    <Unit{attributes(name=unit)}>{inside}</Unit>")
    lines.append("  </UnitDefinitions>")
    lines.append("  <ModelVariables>")
    references = {"Real": 0, "Integer": 0}
    for kind, variable, causality, unit, start, text in variables:
        variability = "fixed" if causality == "parameter" else "discrete"
        lines.append("    <ScalarVariable" + attributes(name=variable, valueReference=references[kind], description=text, causality=causality,
                                                        variability=variability, initial="calculated" if causality == "output" else None)
                     + f"><{kind}{attributes(unit=unit, start=start)}/></ScalarVariable>")
        references[kind] += 1
    lines.append("  </ModelVariables>")
    outputs = [f'<Unknown index="{k}"/>' for k, v in enumerate(variables, 1) if v[2] == "output"]
    lines.append(f"  <ModelStructure><Outputs>{''.join(outputs)}</Outputs><InitialUnknowns>{''.join(outputs)}</InitialUnknowns></ModelStructure>")
    lines.append("</fmiModelDescription>")
    return "\n".join(lines) + "\n"


def date():
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    return datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")


def variables_header(variables, guid):
    """variables.h: value references and start values."""
    lines = [f'#define MODEL_GUID "{guid}"']
    for kind, total in (("Real", "REALS"), ("Integer", "INTEGERS")):
        of_kind = [v for v in variables if v[0] == kind]
        lines.append(f"enum {{ {', '.join(v[1].upper() for v in of_kind)}, {total} }};")
        lines.append(f"#define {kind.upper()}_START_VALUES {', '.join(repr(v[4] or 0) for v in of_kind)}")
    return "\n".join(lines) + "\n"


def main():
    model, prefix, out = sys.argv[1], Path(sys.argv[2]).resolve(), Path(sys.argv[3])
    name, variables_of, about = MODELS[model]
    variables = variables_of(prefix)
    library = ctypes.CDLL(str(prefix / "lib/libstylet.so"))
    library.stylet_version.restype = ctypes.c_char_p
    version = library.stylet_version().decode()
    # Another interface has another identifier.
    guid = "{%s}" % uuid.uuid5(uuid.NAMESPACE_URL, description(name, about, variables, version, ""))
    with tempfile.TemporaryDirectory() as build:
        (Path(build) / "variables.h").write_text(variables_header(variables, guid))
        shared = Path(build) / f"{name}.so"
        # The static library is inside; only the functions of FMI are visible.
        subprocess.run(["cc", "-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-I", build, "-I", prefix / "include", "-I", FMI_HEADERS,
                        HERE / f"{model}.c", HERE / "slave.c", prefix / "lib/libstylet.a", "-Wl,--exclude-libs,ALL", "-Wl,--gc-sections", "-s",
                        "-lm", "-lpthread", "-ldl", "-o", shared], check=True)
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as fmu:
            for path, content in (("modelDescription.xml", description(name, about, variables, version, guid).encode()),
                                  (f"binaries/linux64/{name}.so", shared.read_bytes()),
                                  ("documentation/LICENSE-MIT", (HERE / "../../LICENSE-MIT").read_bytes()),
                                  ("documentation/LICENSE-APACHE", (HERE / "../../LICENSE-APACHE").read_bytes())):
                entry = zipfile.ZipInfo(path)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                fmu.writestr(entry, content)


if __name__ == "__main__":
    main()
