"""Speed of the core beside MuJoCo's on the same tree; run with ``make benchmark``.

No assertion here is timed. The ratio of the two is printed at the end of the module.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

import mujoco
import numpy as np
import pytest

from models.compilation import kernel
from models.crash.record import Summary
from models.criteria import head_injury_criterion
from models.multibody.integration import correct, empty_memory, predict
from models.multibody.kinematics import update_kinematics
from models.multibody.model import MultibodyModel
from models.multibody.setup import build_crash, build_tree
from models.multibody.simulation import simulate
from models.multibody.sweeps import solve_accelerations
from models.multibody.tree import Tree, empty_loads, empty_motion
from models.pedestrian.anthropometry import build_body
from models.registry import load_model

STEPS = 1000
medians: dict[str, float] = {}


@pytest.fixture(scope="module", autouse=True)
def ratio() -> Iterator[None]:
    yield
    if {"ours", "mujoco"} <= set(medians):
        ours, theirs = medians["ours"] / STEPS, medians["mujoco"] / STEPS
        print(
            f"\nfree tree: ours {1e6 * ours:.2f} us a step, MuJoCo {1e6 * theirs:.2f} us, "
            f"ratio {theirs / ours:.1f}"
        )
    if "crash" in medians:
        print(
            f"crash with contacts: {1e3 * medians['crash']:.1f} ms, {medians['steps']:.0f} steps, "
            f"{1e6 * medians['crash'] / medians['steps']:.2f} us a step"
        )


def median_of(benchmark: Any) -> float:
    return float(benchmark.stats.stats.median) if benchmark.stats else float("nan")


def child_tree() -> Tree:
    return build_tree(build_body(7.0, 1.22, 23.2, 3.26))


def mujoco_twin(tree: Tree) -> tuple[Any, Any]:
    def numbers(values: np.ndarray) -> str:
        return " ".join(f"{v:.17g}" for v in values)

    def body(i: int) -> str:
        joint = "<freejoint/>" if i == 0 else '<joint type="ball"/>'
        children = "".join(body(k) for k in range(tree.mass.size) if tree.parent[k] == i)
        return (
            f'<body pos="{numbers(tree.joint_in_parent[i])}">{joint}'
            f'<inertial pos="{numbers(tree.centre_from_joint[i])}" mass="{tree.mass[i]:.17g}" '
            f'diaginertia="{numbers(tree.inertia[i])}"/>{children}</body>'
        )

    xml = f'<mujoco><option timestep="1e-4"/><worldbody>{body(0)}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(xml)
    return model, mujoco.MjData(model)


@kernel
def free_steps(tree, motion, loads, memory, h, n):
    for _ in range(n):
        predict(tree, motion, loads, memory, h)
        update_kinematics(tree, motion)
        solve_accelerations(tree, motion, loads)
        correct(tree, motion, loads, memory, h)


@pytest.fixture
def spin() -> np.ndarray:
    return np.random.default_rng(5).normal(0.0, 5.0, (15, 3))


def test_our_free_tree(benchmark: Callable[..., Any], spin: np.ndarray) -> None:
    tree, motion, loads = child_tree(), empty_motion(15), empty_loads(15)
    motion.angular_velocity[:] = spin
    benchmark(free_steps, tree, motion, loads, empty_memory(15), 1e-4, STEPS)
    medians["ours"] = median_of(benchmark)
    assert np.isfinite(motion.centre).all()


def test_mujoco_free_tree(benchmark: Callable[..., Any], spin: np.ndarray) -> None:
    model, state = mujoco_twin(child_tree())

    def steps() -> None:
        # From the same state every round: an undamped tree spins up without end in its integrator.
        mujoco.mj_resetData(model, state)
        state.qvel[3:] = spin.ravel()
        mujoco.mj_step(model, state, STEPS)

    benchmark(steps)
    medians["mujoco"] = median_of(benchmark)
    assert np.isfinite(state.qpos).all()


def test_whole_crash(benchmark: Any) -> None:
    """From first contact to rest, without the assembly of body and car (timed below)."""
    model = MultibodyModel()
    values = {item.name: item.nominal for item in model.inputs}
    steps = []

    def assembled() -> tuple[tuple[Any, dict[str, float]], dict[str, Any]]:
        return (build_crash(values, model.vehicle), values), {}

    def crash(setup: Any, inputs: dict[str, float]) -> None:
        steps.append(model.follow(setup, inputs).summary[Summary.STEPS])

    # The step loop changes the state that it is given, so every round starts from a new one.
    benchmark.pedantic(crash, setup=assembled, rounds=20, warmup_rounds=1)
    medians["crash"] = median_of(benchmark)
    medians["steps"] = float(steps[0])
    assert steps[0] > 1000


def test_planar_crash(benchmark: Any) -> None:
    """Assembly, run and outputs of a planar crash; its steps are Pymunk's and ours."""
    model = load_model("planar")
    row = np.array([[item.nominal for item in model.inputs]])
    found = benchmark.pedantic(model.run_batch, args=(row,), rounds=20, warmup_rounds=1)
    assert found.status == ["ok"]


def test_spatial_crash(benchmark: Any) -> None:
    """The same of the multibody model."""
    model = MultibodyModel()
    row = np.array([[item.nominal for item in model.inputs]])
    found = benchmark.pedantic(model.run_batch, args=(row,), rounds=20, warmup_rounds=1)
    assert found.status == ["ok"]


def test_row_over_its_step_loop(benchmark: Any) -> None:
    """CPU time of a study's row over that of its step loop, printed; the aim is 1.15."""
    model = MultibodyModel()
    rng = np.random.default_rng(1)
    rows = np.tile([item.nominal for item in model.inputs], (40, 1))
    names = [item.name for item in model.inputs]
    rows[:, names.index("gait_phase")] = rng.random(40)
    loop = 0.0

    def timed(*arguments: Any) -> None:
        nonlocal loop
        start = time.process_time()
        simulate(*arguments)
        loop += time.process_time() - start

    def run() -> float:
        nonlocal loop
        loop = 0.0
        start = time.process_time()
        with mock.patch("models.multibody.model.simulate", timed):
            assert len(model.run_batch(rows).status) == 40
        return (time.process_time() - start) / loop

    ratio = benchmark.pedantic(run, rounds=3, warmup_rounds=1)
    print(f"\nCPU time of a row over its step loop: {ratio:.3f}")
    assert ratio > 1.0


def test_assembly(benchmark: Callable[..., Any]) -> None:
    model = MultibodyModel()
    values = {item.name: item.nominal for item in model.inputs}
    assert benchmark(build_crash, values, model.vehicle) is not None


def test_head_injury_criterion(benchmark: Callable[..., Any]) -> None:
    rng = np.random.default_rng(0)
    times = np.arange(2000) * 1e-4
    pulse = np.abs(150.0 * np.exp(-(((times - 0.08) / 0.006) ** 2)) + rng.normal(0.0, 3.0, 2000))
    hic, _, _ = benchmark(head_injury_criterion, times, pulse)
    assert hic > 100.0
