"""Reference numbers for `tests/reference.rs`: the Panda with F/T sensor and needle in Pinocchio and in MuJoCo.

    python3 -m venv venv && venv/bin/pip install -r requirements.txt && venv/bin/python make_reference.py

Writes next to itself:
  states.csv      1000 random states: joint angles (rad), rates (rad/s), accelerations (rad/s^2), wrench on the tip (N, N m; base
                  coordinates), three decimals
  pinocchio.f64   little-endian f64, per state: torques 7 (with gravity 9.81 m/s^2 and the wrench), mass matrix 28 (upper triangle, by
                  rows), tip Jacobian 42 (by rows, linear first, base coordinates), C^T(q, qd) qd 7
  mujoco.f64      the same without the last 7

The arm comes from the URDF of `example-robot-data` for both, read independently: Pinocchio parses the URDF, MuJoCo gets a model written
here from its numbers. The payload is stated here a second time, not taken from the Rust code.
"""

import importlib.metadata
import math
import pathlib
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin

HERE = pathlib.Path(__file__).resolve().parent
STATES = 1000
GRAVITY = 9.81
FLANGE = "panda_link8"

# F/T sensor: cylinder on the flange; needle: rod on the sensor, centre of mass 90 mm from its base; tip at the needle's end.
SENSOR = dict(mass=0.236, com=0.015, radius=0.0225, length=0.03)
NEEDLE = dict(mass=0.068, com=0.03 + 0.09, radius=0.003, length=0.153)
TIP = 0.03 + 0.153


def urdf_text():
    for file in importlib.metadata.files("example-robot-data"):
        if file.name == "panda.urdf":
            return pathlib.Path(file.locate()).read_text()
    raise SystemExit("example-robot-data has no panda.urdf")


def bare_urdf():
    """The URDF up to the flange, without hand and meshes."""
    root = ET.fromstring(urdf_text())
    keep = {f"panda_link{i}" for i in range(9)}
    for element in list(root):
        if element.tag == "link":
            for mesh in element.findall("visual") + element.findall("collision"):
                element.remove(mesh)
            if element.get("name") not in keep:
                root.remove(element)
        elif element.tag == "joint" and element.find("child").get("link") not in keep:
            root.remove(element)
    return root


def cylinder_inertia(mass, radius, length, **_):
    across = mass * (3 * radius**2 + length**2) / 12
    return [across, across, mass * radius**2 / 2]


def numbers(text):
    return [float(word) for word in text.split()]


def pinocchio_model():
    model = pin.buildModelFromXML(ET.tostring(bare_urdf(), encoding="unicode"))
    flange = model.frames[model.getFrameId(FLANGE)]
    joint = flange.parentJoint
    for part in (SENSOR, NEEDLE):
        inertia = pin.Inertia(part["mass"], np.array([0, 0, part["com"]]), np.diag(cylinder_inertia(**part)))
        model.appendBodyToJoint(joint, inertia, flange.placement)
    placement = flange.placement * pin.SE3(np.eye(3), np.array([0, 0, TIP]))
    tip = model.addFrame(pin.Frame("tip", joint, placement, pin.FrameType.OP_FRAME))
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    return model, tip


def mujoco_model():
    root = bare_urdf()
    links = {link.get("name"): link for link in root.findall("link")}
    joints = [joint for joint in root.findall("joint")]
    text = lambda values: " ".join(repr(float(v)) for v in values)

    def inertial(link):
        element = links[link].find("inertial")
        if element is None or float(element.find("mass").get("value")) == 0.0:
            return ""
        assert numbers(element.find("origin").get("rpy")) == [0, 0, 0]
        i = element.find("inertia")
        full = [i.get(k) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")]
        return (
            f'<inertial pos="{element.find("origin").get("xyz")}" mass="{element.find("mass").get("value")}" '
            f'fullinertia="{" ".join(full)}"/>'
        )

    def body(name):
        out = inertial(name)
        for joint in joints:
            if joint.find("parent").get("link") != name:
                continue
            origin, child = joint.find("origin"), joint.find("child").get("link")
            roll, pitch, yaw = numbers(origin.get("rpy"))
            assert pitch == 0 and yaw == 0
            quat = [math.cos(roll / 2), math.sin(roll / 2), 0, 0]
            out += f'<body name="{child}" pos="{origin.get("xyz")}" quat="{text(quat)}">'
            if joint.get("type") == "revolute":
                out += f'<joint name="{joint.get("name")}" type="hinge" axis="{joint.find("axis").get("xyz")}"/>'
            out += body(child) + "</body>"
        if name == FLANGE:
            for part in (SENSOR, NEEDLE):
                out += (
                    f'<body><inertial pos="{text([0, 0, part["com"]])}" mass="{part["mass"]}" '
                    f'diaginertia="{text(cylinder_inertia(**part))}"/></body>'
                )
            out += f'<site name="tip" pos="0 0 {TIP}"/>'
        return out

    xml = (
        '<mujoco><compiler angle="radian" autolimits="false"/>'
        f'<option gravity="0 0 {-GRAVITY}"><flag contact="disable" constraint="disable"/></option>'
        f'<worldbody><body name="panda_link0">{body("panda_link0")}</body></worldbody></mujoco>'
    )
    return mujoco.MjModel.from_xml_string(xml)


def random_states(model):
    rng = np.random.default_rng(20190701)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    q = rng.uniform(lower, upper, (STATES, 7))
    qd = rng.uniform(-2, 2, (STATES, 7))
    qdd = rng.uniform(-10, 10, (STATES, 7))
    wrench = np.hstack([rng.uniform(-20, 20, (STATES, 3)), rng.uniform(-2, 2, (STATES, 3))])
    return np.round(np.hstack([q, qd, qdd, wrench]), 3)


def main():
    upper = np.triu_indices(7)
    pm, tip = pinocchio_model()
    pd = pm.createData()
    mm = mujoco_model()
    md = mujoco.MjData(mm)
    site = mm.site("tip").id
    states = random_states(pm)
    from_pinocchio, from_mujoco = [], []
    for row in states:
        q, qd, qdd, wrench = row[:7], row[7:14], row[14:21], row[21:]

        jacobian = pin.computeFrameJacobian(pm, pd, q, tip, pin.LOCAL_WORLD_ALIGNED)
        torque = pin.rnea(pm, pd, q, qd, qdd) - jacobian.T @ wrench
        mass = pin.crba(pm, pd, q)
        coriolis = pin.computeCoriolisMatrix(pm, pd, q, qd)
        from_pinocchio.append(np.concatenate([torque, mass[upper], jacobian.ravel(), coriolis.T @ qd]))

        md.qpos[:], md.qvel[:], md.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(mm, md)
        jacobian = np.zeros((6, 7))
        mujoco.mj_jacSite(mm, md, jacobian[:3], jacobian[3:], site)
        applied = np.zeros(7)
        mujoco.mj_applyFT(mm, md, wrench[:3], wrench[3:], md.site_xpos[site], mm.site_bodyid[site], applied)
        mass = np.zeros((7, 7))
        mujoco.mj_fullM(mm, md, mass)
        from_mujoco.append(np.concatenate([md.qfrc_inverse - applied, mass[upper], jacobian.ravel()]))

    p, m = np.array(from_pinocchio), np.array(from_mujoco)
    for name, a, b in (("torques", 0, 7), ("mass matrix", 7, 35), ("Jacobian", 35, 77)):
        error = np.abs(p[:, a:b] - m[:, a:b]).max(1) / np.abs(p[:, a:b]).max(1)
        print(f"Pinocchio against MuJoCo, {name}: max relative difference {error.max():.1e}")
    np.savetxt(HERE / "states.csv", states, "%.3f", ",")
    p.astype("<f8").tofile(HERE / "pinocchio.f64")
    m.astype("<f8").tofile(HERE / "mujoco.f64")


if __name__ == "__main__":
    main()
