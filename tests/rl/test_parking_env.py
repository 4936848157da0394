"""The parking task as a Gymnasium environment."""

import importlib

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

import koopman_lab as kl
import offboard.rl
from koopman_lab import installation
from koopman_lab.errors import ArgumentError, ConfigError, InstallationError, UsageError
from offboard.rl import PARKING
from offboard.rl.parking_env import ParkingEnv

BROKEN = "simulation.faults=[{kind: motor_stalled, at_s: 0.5, wheel: both}]"
GOAL = (0.4, -0.3, 1.0)


def towards(env, controller):
    """Drive with a controller until the end; return rewards and the last of what a step returns."""
    x, info = env.reset(seed=3)
    rewards = []
    while not info["end"]:
        action = controller.step(x).u / env.unwrapped.u_max
        x, reward, terminated, truncated, info = env.step(action)
        rewards.append(reward)
        assert x in env.observation_space
        assert (terminated or truncated) == bool(info["end"])
    return rewards, (x, terminated, truncated, info)


@pytest.mark.parametrize("preset", ["lab", "harsh", "ideal"])
@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_it_is_what_gymnasium_asks_of_an_environment(robot, preset):
    env = gymnasium.make(PARKING, robot=robot, preset=preset)
    check_env(env.unwrapped)
    env.close()


def test_it_is_found_by_its_name_alone():
    env = gymnasium.make(f"offboard.rl:{PARKING}")
    assert isinstance(env.unwrapped, ParkingEnv)


def test_without_the_extra_it_says_what_installs_it(monkeypatch):
    there = installation._is_installed
    monkeypatch.setattr(installation, "_is_installed", lambda n: n != "gymnasium" and there(n))
    with pytest.raises(InstallationError, match=r"\(gymnasium\).*koopman-lab\[rl\]"):
        importlib.reload(offboard.rl)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
@pytest.mark.parametrize("cost", ["me", "ce"])
def test_the_reward_is_the_stage_cost_of_the_state_before_and_the_input(robot, cost):
    env = ParkingEnv(robot=robot, cost=cost, goal=GOAL)
    controller = kl.Controller(robot=robot, cost=cost, use_compiler=False, horizon=2)
    x, _ = env.reset(seed=1)
    for _ in range(20):
        action = env.action_space.sample()
        expected = -controller.stage_cost(x, action * env.u_max)
        x, reward, *_ = env.step(action)
        assert reward == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("robot", ["kinematic", "dynamic"])
def test_the_predictive_controller_is_a_policy_that_parks(robot):
    env = gymnasium.make(PARKING, robot=robot, goal=GOAL)
    controller = kl.Controller(robot=robot)
    rewards, (x, terminated, truncated, info) = towards(env, controller)
    settings = controller.config.controller
    assert (info["end"], terminated, truncated) == ("parked", True, False)
    assert np.abs(x[:2]) == pytest.approx([0.0, 0.0], abs=max(settings.parked_position_m))
    assert info["pose"][:2] == pytest.approx(GOAL[:2], abs=0.02)
    assert rewards[-1] > 1e-3 * rewards[0]
    assert info["time_s"] == pytest.approx(len(rewards) * settings.dt_s)


def test_who_is_content_too_early_is_not_parked():
    env = ParkingEnv(parked_hold_s=0.5, time_limit_s=1.0, preset="ideal")
    env.reset(options={"start": (0.0, 0.0, 0.0)})
    ends = [env.step(np.zeros(2))[4]["end"] for _ in range(10)]
    assert ends == [""] * 9 + ["parked"]
    env.reset(options={"start": (0.1, 0.0, 0.0)})
    *_, terminated, truncated, info = [env.step(np.zeros(2)) for _ in range(20)][-1]
    assert (terminated, truncated, info["end"]) == (False, True, "time limit")


@pytest.mark.parametrize(
    ("overrides", "start", "end"),
    [((), (2.4, 0.0, 0.0), "off the floor"), ((BROKEN,), (0.0, 0.0, 0.0), "stopped")],
)
def test_to_leave_early_costs_what_standing_there_would(overrides, start, end):
    env = ParkingEnv(kl.load_config(overrides=overrides), goal=GOAL, time_limit_s=4.0)
    x, info = env.reset(seed=0, options={"start": start})
    controller = kl.Controller(robot="kinematic", use_compiler=False, horizon=2)
    action, steps = np.array([1.0, 0.0]), 0
    while not info["end"]:
        before = x
        x, reward, terminated, _, info = env.step(action)
        steps += 1
    assert (info["end"], terminated) == (end, True)
    left = 80 - steps
    assert left > 0
    expected = controller.stage_cost(before, action * env.u_max)
    expected += left * controller.stage_cost(x, np.zeros(2))
    assert reward == pytest.approx(-expected, rel=1e-12)


def single_runs(seeds, actions):
    """Return the observations of environments one by one, each up to its end."""
    for seed, own in zip(seeds, actions, strict=True):
        env = ParkingEnv(time_limit_s=5.0)
        x, _ = env.reset(seed=seed)
        yield [x, *(env.step(action)[0] for action in own)]


@pytest.mark.parametrize("kind", [SyncVectorEnv, AsyncVectorEnv])
def test_many_at_once_are_as_many_one_by_one(kind):
    """In one process, or in a process each."""
    options = {"autoreset_mode": AutoresetMode.NEXT_STEP}
    if kind is AsyncVectorEnv:
        options["context"] = "spawn"
    mode = "sync" if kind is SyncVectorEnv else "async"
    envs = gymnasium.make_vec(PARKING, 2, mode, options, time_limit_s=5.0)
    assert isinstance(envs, kind)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (30, 2, 2))
    try:
        x, _ = envs.reset(seed=[5, 6])
        seen = [x, *(envs.step(action)[0] for action in actions)]
    finally:
        envs.close()
    for place, expected in enumerate(single_runs((5, 6), actions.swapaxes(0, 1))):
        np.testing.assert_array_equal([x[place] for x in seen], expected)


def test_starts_follow_the_seed_and_go_on_without_one():
    env = ParkingEnv()
    first = [env.reset(seed=2)[0], env.reset()[0]]
    again = [env.reset(seed=2)[0], env.reset()[0]]
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(*first)


def test_goal_and_start_of_a_reset_hold_for_it_alone():
    env = ParkingEnv(preset="ideal")
    x, info = env.reset(options={"start": (1.0, 0.0, 0.0), "goal": (1.0, 0.5, 0.0)})
    assert info["pose"] == pytest.approx([1.0, 0.0, 0.0])
    assert x == pytest.approx([0.0, -0.5, 0.0])
    x, info = env.reset()
    assert x == pytest.approx(info["pose"])


def test_a_picture_shows_the_floor():
    env = ParkingEnv(render_mode="rgb_array")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()
    env.reset(seed=0, options={"start": (-1.0, 1.0, 0.0)})
    before = env.render()
    assert before.dtype == np.uint8
    assert before.shape[2] == 3
    for _ in range(10):
        env.step(np.array([1.0, 0.0]))
    assert not np.array_equal(before, env.render())
    assert ParkingEnv().render() is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"begin": (0, 0, 0)}, "unknown begin; known: start, goal"),
        ({"start": (0.0, 0.0)}, r"start: shape \(2,\), expected \(3,\)"),
        ({"goal": (0.0, float("nan"), 0.0)}, r"goal: nan at \(1,\)"),
        ({"goal": (9.0, 0.0, 0.0)}, r"goal: x1 = 9 m is outside \[-2\.5, 2\.5\] m"),
    ],
)
def test_a_reset_that_cannot_be_is_refused_in_words(options, said):
    env = ParkingEnv()
    with pytest.raises((ArgumentError, UsageError), match=said):
        env.reset(options=options)


def test_what_cannot_be_driven_is_refused_in_words():
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"reset\(\)"):
        ParkingEnv().step(np.zeros(2))
    env = ParkingEnv()
    env.reset()
    with pytest.raises(ArgumentError, match=r"action: shape \(3,\), expected \(2,\).*share of v"):
        env.step(np.zeros(3))
    with pytest.raises(ArgumentError, match="action: nan"):
        env.step(np.array([np.nan, 0.0]))
    with pytest.raises(ConfigError, match=r"did you mean controller\.horizon"):
        ParkingEnv(horizn=3)
    with pytest.raises(UsageError, match="goal: x1"):
        ParkingEnv(goal=(7.0, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="render_mode: 'human', expected 'rgb_array' or None"):
        ParkingEnv(render_mode="human")
    with pytest.raises(ConfigError, match="simulation: null"):
        ParkingEnv(preset="real")


def test_an_action_beyond_the_largest_is_cut_off():
    cut, largest = ParkingEnv(preset="ideal"), ParkingEnv(preset="ideal")
    for env in (cut, largest):
        env.reset(options={"start": (0.0, 0.0, 0.0)})
    beyond, one = cut.step(np.array([3.0, -9.0])), largest.step(np.array([1.0, -1.0]))
    np.testing.assert_array_equal(beyond[0], one[0])
    assert beyond[1] == one[1]
