"""A cost and a predictor of a stranger; a test writes this file into a package of its own."""

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from koopman_lab.config.cost_table import Cost
from koopman_lab.geometry.planar import ORIGIN
from koopman_lab.koopman.model_file import write_model_file
from koopman_lab.predictors.predictor import StatePrediction
from koopman_lab.predictors.table import Predictor, file_header
from koopman_lab.robots.table import robot_type


class Fourth:
    """Fourth powers of everything but the sideways deviation, which is squared."""

    def __init__(self, q, r, robot, observables):
        del observables
        self.parameters = np.array([*q, *r])
        self._powers = [2 if i in robot.sideways else 4 for i in range(len(q))] + [4] * len(r)

    def __call__(self, x, u, parameters=None):
        weights = self.parameters if parameters is None else parameters
        values = [x[i] for i in range(len(self._powers) - 2)] + [u[0], u[1]]
        cost = 0.0
        for i, power in enumerate(self._powers):
            cost = cost + weights[i] * (values[i] ** 2) ** (power // 2)
        return cost


def _weights(robot):
    return (1.0, 5.0, 0.1) + (0.1,) * (robot.state_dim - 3), (0.05,) * robot.input_dim


FOURTH = Cost("fourth", Fourth, weights=_weights)


@dataclass(frozen=True)
class Gains:
    """The nominal equations with two numbers learned: how much of v and omega is really driven."""

    robot: object
    dt_s: float
    gains: tuple
    metadata: dict = field(default_factory=dict)
    predictor = "gains"
    name = "gains"
    lifts = False
    marker_offset = ORIGIN

    def predict(self, x0, inputs, *, reproject=True):
        del reproject
        states = [np.asarray(x0, float)]
        for k in range(inputs.shape[-2]):
            driven = inputs[..., k, :] * np.array(self.gains)
            states.append(self.robot.step(states[-1], driven, self.dt_s))
        return np.stack(states, axis=-2)

    def save(self, path):
        header = {"robot": self.robot.name, "dt_s": self.dt_s, "metadata": self.metadata}
        write_model_file(path, file_header("gains") | header, {"gains": np.array(self.gains)})


def load(file):
    header = file.header
    gains = tuple(file.arrays["gains"].tolist())
    return Gains(robot_type(header["robot"]), header["dt_s"], gains, header["metadata"])


class Prediction(StatePrediction):
    def __init__(self, model):
        self.robot, self.dt_s, self.marker_offset = model.robot, model.dt_s, model.marker_offset
        self.parameters = np.array([*model.gains, model.dt_s])

    def step(self, s, u, parameters):
        states = [s[i] for i in range(self.state_dim)]
        driven = [u[i] * parameters[i] for i in range(2)]
        return ca.vertcat(*self.robot.components(states, driven, parameters[2], ca))


class Report:
    def __init__(self, gains, pairs):
        self._facts = {"gains": gains, "pairs": pairs}

    def as_dict(self):
        return self._facts


class Fit:
    """How far each pair moved along and turned, over what was asked for; least squares."""

    def __init__(self, observables, method):
        del observables, method
        self._moved, self._asked = [[], []], [[], []]

    def add(self, dataset):
        self._robot, self._dt_s = robot_type(dataset.robot_kind), dataset.dt_s
        for index, u in dataset.basis_inputs.items():
            x, y = dataset.X.get(index, np.empty((0, 3))), dataset.Y.get(index, np.empty((0, 3)))
            middle = (x[:, 2] + y[:, 2]) / 2
            along = np.cos(middle) * (y - x)[:, 0] + np.sin(middle) * (y - x)[:, 1]
            for k, moved in enumerate((along, (y - x)[:, 2])):
                self._moved[k].extend(moved)
                self._asked[k].extend([u[k] * dataset.dt_s] * len(moved))

    def result(self):
        gains = tuple(
            float(np.dot(asked, moved) / np.dot(asked, asked))
            for asked, moved in zip(self._asked, self._moved, strict=True)
        )
        model = Gains(self._robot, self._dt_s, gains, {"made": "by a stranger"})
        return model, Report(list(gains), len(self._moved[0]))


GAINS = Predictor("gains", load, Prediction, Fit)
