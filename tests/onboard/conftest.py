import pytest
from motor_bench import Bench

from koopman_lab.config.load import load_config


@pytest.fixture
def kinematic():
    return Bench(load_config(robot="kinematic"))


@pytest.fixture
def dynamic():
    return Bench(load_config(robot="dynamic"))
