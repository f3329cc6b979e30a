"""Tests of the simulator, and of the plant for your own controllers."""

import _thread
import threading

import numpy as np
import pytest

from openjtc import Arm, DeviceError, FaultError, UsageError
from openjtc.control import encode
from openjtc.dynamics import Dynamics, Payload
from openjtc.sim import ModelError, Plant, Simulator


def ready(**arguments):
    simulator = Simulator(Arm.avena(), **arguments)
    simulator.bring_up()
    return simulator


def test_the_same_seed_gives_the_same_bytes():
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print("seed", seed)

    def run(seed):
        simulator = Simulator(seed=seed, answer_jitter_ms=2)
        simulator.command(*encode.use_defaults())
        simulator.step(6_000)
        return simulator.telemetry.to_bytes(), simulator.position.tobytes()

    assert run(seed) == run(seed)
    assert run(seed) != run(seed + 1)


def test_a_stored_arm_is_brought_up_and_held():
    simulator = ready()
    simulator.step(100)
    assert simulator.status.state == "HoldPos" and simulator.status.errors == 0
    before = simulator.position
    simulator.step(1000)
    assert np.abs(simulator.position - before).max() < 1e-3
    assert simulator.safety_output and simulator.bus_frames and 0 < simulator.statistics["bus_load"] < 1
    assert any("HoldPos" in words for _, words in simulator.events)


def test_a_long_step_is_ended_by_ctrl_c():
    simulator, plant = Simulator(), Plant()
    for step in (lambda: simulator.step(10**9), lambda: plant.step(np.zeros(6), ms=10**9)):
        timer = threading.Timer(0.3, _thread.interrupt_main)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            step()
        timer.join()
    assert simulator.time > 0.5 and plant.time > 0.5


def test_a_push_moves_the_arm_and_it_comes_back():
    simulator = ready()
    before = simulator.position
    simulator.push(np.int64(1), np.float32(80.0), 0.2)
    simulator.step(100)
    assert simulator.outside_torque[0] == 80.0
    simulator.step(100)
    pushed = np.abs(simulator.position - before)
    simulator.step(3_000)
    assert pushed[0] > 1e-4 and np.abs(simulator.position - before).max() < pushed[0] + 1e-3
    assert simulator.outside_torque[0] == 0.0 and simulator.telemetry.state == "HoldPos"


def test_a_hand_leads_a_taught_arm():
    simulator = ready()
    goal = simulator.position + [0.2, 0.1, -0.1, 0, 0, 0]
    simulator.lead([simulator.position, goal], step=2.0)
    simulator.command(encode.teach())
    simulator.wait("Teaching")
    simulator.step(2_600)
    assert np.abs(simulator.position - goal).max() < 0.05
    simulator.command(encode.hold())
    simulator.wait("HoldPos")


def test_faults_end_the_motion_and_are_refused_where_they_make_no_sense():
    simulator = ready()
    simulator.inject({"kind": "hardware-fault", "joint": 3, "for_s": 0.1})
    simulator.step(300)
    assert simulator.telemetry.state == "Error" and simulator.status.causes
    with pytest.raises(FaultError, match="is in Error"):
        simulator.wait("HoldPos", limit=1.0)
    for wrong in ({"kind": "melts"}, {"kind": "push", "joint": 7, "torque_nm": 1, "for_s": 1}, {"kind": "push"}):
        with pytest.raises(UsageError):
            simulator.inject(wrong)
    with pytest.raises(UsageError, match="format"):
        Simulator(faults="[[fault]]")
    with pytest.raises(DeviceError):
        simulator.command(encode.execute())


def test_the_safety_input_is_an_error():
    simulator = ready()
    simulator.set_safety_input(False)
    simulator.step(100)
    assert simulator.telemetry.state == "Error" and simulator.status.causes


def test_a_payload_hangs_on_the_arm():
    start = [0.0, 0.6, -1.0, 0.3, 0.4, 0.0]
    light, heavy = (
        ready(model_error=None, friction=False, start=start, payload=payload) for payload in (None, Payload(3.0))
    )
    for simulator in (light, heavy):
        simulator.step(4_000)
    extra = Dynamics(Arm.avena(), Payload(3.0)).gravity(light.position) - Dynamics(Arm.avena()).gravity(light.position)
    more = heavy.torque - light.torque
    # Without friction, the drives carry the whole torque that the payload causes.
    assert abs(extra[1]) > 5.0 and abs(more[1] - extra[1]) < 0.2 * abs(extra[1]), (more, extra)


@pytest.mark.parametrize("drives", [True, False])
def test_gravity_compensation_holds_the_plant(drives):
    start = [0.0, 0.6, -1.0, 0.3, 0.4, 0.0]
    plant = Plant(Arm.avena(), start=start, model_error=None, drives=drives)
    model = Dynamics(Arm.avena())
    state = plant.state
    assert np.abs(state.position - start).max() < 1e-3 and state.time == 0.0 and not state.faulted
    for _ in range(1_000):
        state = plant.step(model.gravity(state.position))
    assert np.abs(plant.true_position - start).max() < 2e-3 and state.time == 1.0
    state = plant.step(np.zeros(6), ms=400)
    assert np.abs(plant.true_position - start).max() > 0.02
    plant.reset(start)
    assert plant.time == 0.0 and np.abs(plant.true_position - start).max() < 1e-5


def test_an_arm_without_friction_follows_its_dynamics():
    """Compares the plant with the explicit integration of `Dynamics.forward` in steps of 0.1 ms."""
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    arm = Arm.avena()
    start, torque = rng.uniform(-0.5, 0.5, 6), rng.uniform(-5, 5, 6)
    plant = Plant(arm, start=start, model_error=None, friction=False, drives=False)
    model, q, v, dt = Dynamics(arm), start.copy(), np.zeros(6), 1e-4
    tau = torque + model.gravity(start)
    for _ in range(2_000):
        middle = v + 0.5 * dt * model.forward(q, v, tau)
        v = v + dt * model.forward(q + 0.5 * dt * v, middle, tau)
        q = q + dt * middle
    state = plant.step(tau, ms=200)
    assert np.abs(state.velocity).max() > 0.05
    assert np.allclose(state.position, q, rtol=0, atol=1e-5)
    assert np.allclose(state.velocity, v, rtol=0, atol=1e-4)


def test_drives_measure_as_drives_do_and_trip():
    plant = Plant(Arm.avena(), start=[0.1234567, 0, 0, 0, 0, 0], friction=False, model_error=None)
    step = 2 * np.pi / 65536
    state = plant.state
    assert abs(state.position[0] - 0.1234567) < step and state.position[0] != 0.1234567
    assert np.array_equal(plant.torque_max, [364, 364, 364, 79, 79, 79])
    for _ in range(400):
        state = plant.step([0, 0, 0, 0, 0, 70.0])
        if state.faulted:
            break
    assert state.faulted and not state.enabled[5]
    state = plant.step(np.zeros(6), ms=200)
    assert state.errors[5] != 0
    assert abs(plant.true_velocity[5]) < 1e-9
    assert not plant.reset(np.zeros(6)).faulted


def test_the_plant_of_a_seed_is_the_arm_of_its_simulator():
    """Replays the torques of the simulator's controller. The plant with the same seed must move in the same way, and the plant with another
    seed must move differently."""
    about = {"model_error": ModelError(mass=0.3), "start": [0, 0.4, -0.8, 0, 0.2, 0]}
    simulator = Simulator(Arm.avena(), seed=11, **about)
    simulator.wait("Init")
    simulator.write(b"".join(encode.use_defaults()))
    while np.array_equal(simulator.position, about["start"]):
        simulator.step()
    # The drives of the simulator were enabled in an earlier millisecond, like the drives of a new plant.
    plants = [Plant(Arm.avena(), seed=seed, **about) for seed in (11, 12)]
    for _ in range(500):
        simulator.step()
        for plant in plants:
            plant.step(simulator.torque)
        moved = [np.abs(plant.true_position - simulator.position).max() for plant in plants]
    assert moved[0] < 1e-8 and moved[1] > 1e-5, moved


def test_wrong_arguments_are_explained():
    with pytest.raises(UsageError, match="joint 2 at 9 rad"):
        Plant(start=[0, 9, 0, 0, 0, 0])
    with pytest.raises(UsageError, match="torque: joint 1 is not finite: NaN"):
        Plant().step([np.nan, 0, 0, 0, 0, 0])
    for wrong in (ModelError(mass=-1), ModelError(mass=1.5), ModelError(friction=1.1), ModelError(mass_factors=[11] * 7)):
        with pytest.raises(UsageError, match="model_error"):
            Plant(model_error=wrong)
    for arguments in (
        {"seed": -1},
        {"start": [0] * 5},
        {"model_error": ModelError(mass_factors=[1] * 6)},
        {"model_error": ModelError(friction_factors=[1] * 7)},
    ):
        with pytest.raises(UsageError, match=next(iter(arguments)) + "|factors"):
            Plant(**arguments)
    with pytest.raises(UsageError, match="ms: -1"):
        Plant().step(np.zeros(6), ms=-1)
    with pytest.raises(UsageError, match="ms: -1"):
        Simulator().step(-1)
    with pytest.raises(UsageError, match="gravity"):
        Dynamics(Arm.avena(), gravity=[0, 0])
    with pytest.raises(UsageError, match="support"):
        Simulator(support="rope")
    with pytest.raises(UsageError, match="step"):
        Simulator().lead([[0] * 6], step=0)
    with pytest.raises(RuntimeError, match="watch"):
        Simulator().inputs


def test_an_arm_on_gears_that_yield_meets_a_wall_and_takes_up_a_load():
    simulator = Simulator(baud=None, model_error=None, gear_stiffness=20_000.0, over_speed=[3.0] * 6)
    simulator.bring_up()
    wall = {"kind": "joint-wall", "joint": 1, "rad": 0.01, "side": "above", "stiffness_nm_rad": 5_000.0}
    simulator.inject(wall)
    simulator.inject({"kind": "payload", "mass_kg": 1.0, "com_m": np.array([0.0, 0.0, 0.05]), "for_s": 0.5})
    simulator.push(1, 79.0, 0.2)
    outside = []
    for _ in range(200):
        simulator.step()
        outside.append(simulator.outside_torque[0])
        assert simulator.position[0] < 0.05
    assert max(outside) == 79.0 and min(outside) < 70.0  # the wall acts against the push
    assert any("payload 1 kg" in text for _, text in simulator.events)
    for wrong, match in (
        ({"gear_stiffness": 5.0}, "gear_stiffness: joint 1: 5 N·m/rad is out of range"),
        ({"over_speed": [1.0] * 5 + [0.0]}, "over_speed: joint 6: 0 rad/s is out of range"),
        ({"gear_stiffness": [1e4, 1e4]}, "gear_stiffness: shape"),
    ):
        with pytest.raises(UsageError, match=match):
            Simulator(**wrong)
