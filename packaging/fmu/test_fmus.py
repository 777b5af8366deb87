"""Runs the FMUs with FMPy: python test_fmus.py ENHANCER.fmu TISSUE.fmu recording.csv PREFIX. Prints the hash of the enhanced force.

The tissue must give bitwise the forces of the C library, and so those of Rust (crates/capi/tests/tissue.rs)."""

import ctypes
import shutil
import struct
import sys
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from enhanced_hash import enhanced_hash, recorded_samples  # noqa: E402


def outputs_of(fmu, inputs, rows, outputs):
    """Steps an FMU from sample to sample; `rows` have the time first. Returns the outputs of each sample."""
    problems = validate_fmu(fmu)
    assert not problems, f"{fmu}: {problems}"
    description = fmpy.read_model_description(fmu)
    reference = {v.name: v.valueReference for v in description.modelVariables}
    folder = fmpy.extract(fmu)
    slave = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier=description.coSimulation.modelIdentifier, instanceName="tested")
    try:
        slave.instantiate()
        for v in description.modelVariables:
            if v.start is not None and v.type == "Real":
                assert slave.getReal([v.valueReference]) == [float(v.start)], v.name
        slave.setupExperiment(startTime=rows[0][0])
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        given, taken = [reference[name] for name in inputs], [reference[name] for name in outputs]
        results = []
        for k, (time_s, *values) in enumerate(rows):
            slave.setReal(given, values)
            step = rows[k + 1][0] - time_s if k + 1 < len(rows) else 1.0
            slave.doStep(currentCommunicationPoint=time_s, communicationStepSize=step)
            results.append(tuple(slave.getReal(taken)))
        slave.terminate()
        slave.freeInstance()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return results


def forces_of_the_library(prefix, rows):
    """Force and tip force of the C library for the three gels, by ctypes."""
    library = ctypes.CDLL(f"{prefix}/lib/libstylet.so")

    class Force(ctypes.Structure):
        _fields_ = [(name, ctypes.c_double) for name in ("total_n", "elastic_n", "friction_n", "tip_n")] + [("active_layer", ctypes.c_uint32)]

    layers = (ctypes.c_double * 12)(0.0282, 40.0, 9000.0, 0.0, 0.0377, 60.0, 12000.0, 2.2, 0.0322, 80.0, 16000.0, 0.0)
    tissue, force = ctypes.c_void_p(), Force()
    assert library.stylet_tissue_new(layers, ctypes.c_size_t(3), ctypes.c_double(0.0), ctypes.byref(tissue), None) == 0
    results = []
    for row in rows:
        assert library.stylet_tissue_step(tissue, *map(ctypes.c_double, row), ctypes.byref(force)) == 0
        results.append((force.total_n, force.elastic_n, force.friction_n, force.tip_n))
    library.stylet_tissue_free(tissue)
    assert force.active_layer == 4, "the recording goes through all layers"
    return results


def main():
    enhancer, tissue, recording, prefix = sys.argv[1:]
    rows = recorded_samples(recording)
    enhanced = outputs_of(enhancer, ("position_m", "velocity_mps", "force_n"), rows, ("enhanced_n",))
    motion = [row[:3] for row in rows]
    forces = outputs_of(tissue, ("position_m", "velocity_mps"), motion, ("force_n", "elastic_n", "friction_n", "tip_n"))
    for k, (fmu, library) in enumerate(zip(forces, forces_of_the_library(prefix, motion), strict=True)):
        assert struct.pack("<4d", *fmu) == struct.pack("<4d", *library), f"tissue, sample {k}: {fmu} instead of {library}"
    print(enhanced_hash(value for (value,) in enhanced))


if __name__ == "__main__":
    main()
