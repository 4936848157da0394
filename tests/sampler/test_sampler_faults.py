"""A session with the whole lab in lockstep, and something that fails in the middle of a run."""

import numpy as np
import pytest

from koopman_lab.bus.channels import FAULT, SAMPLER_STATE
from koopman_lab.config.load import load_config
from koopman_lab.config.simulation import Fault
from koopman_lab.data.dataset import DataSet
from koopman_lab.data.decode import SessionLog
from koopman_lab.emulation.faults import fault_message
from offboard.lab.nodes import lockstep_lab
from offboard.lab.run_folder import RunFolder
from offboard.sampler.node import SamplerNode
from offboard.sampler.sampler_step import Phase

NEAR = (
    *("sampler.draw_set.x1_m=[0.4, 0.8]", "sampler.draw_set.x2_m=[-0.2, 0.2]"),
    *("sampler.segments_per_basis=1", "sampler.largest_steps=60", "mocap.rate_hz=60"),
)
LIMIT_S = 300.0


@pytest.mark.parametrize(
    ("kind", "lasts_s", "noticed_s", "reason"),
    [
        # The timeout of the poses, or of the motor loop's status, and two steps.
        ("occlusion", 4.0, 0.2, "tracking lost"),
        ("radio_cut", 2.5, 1.1, "onboard loop or logger silent"),
    ],
)
def test_the_session_pauses_goes_on_and_keeps_the_run_out_of_the_data(
    tmp_path, kind, lasts_s, noticed_s, reason
):
    config = load_config(robot="kinematic", overrides=NEAR)
    node, folder = SamplerNode(config), RunFolder(tmp_path)
    lab = lockstep_lab(config, folder, node)
    assert lab.run(LIMIT_S, until=lambda: node.sampler.phase is Phase.BASIS)
    struck_us, done = lab.now_us, node.sampler.done
    lab.publish(FAULT, fault_message(Fault(kind=kind, duration_s=lasts_s), struck_us))
    assert lab.run(LIMIT_S)
    lab.close()
    outcome = node.outcome()
    assert (outcome.complete, outcome.segments) == (True, 2)
    assert outcome.redraws[reason] == 1

    log = SessionLog(folder.log)
    states = log.array(SAMPLER_STATE)
    ends_us = struck_us + round(lasts_s * 1e6)
    paused = (states["utime"] > struck_us + noticed_s * 1e6) & (states["utime"] < ends_us)
    assert set(states["phase"][paused]) == {Phase.BRAKE}
    assert set(states["segments_done"][paused]) == {done}
    dataset = DataSet.from_log(log)
    assert dataset.metadata["runs"] == 2
    assert dataset.metadata["runs_given_up"] == 1
    # The run that was cut has nothing in the data, neither before the fault nor during it.
    under_way = states[(states["phase"] == Phase.BASIS) & (states["utime"] <= struck_us)][-1]
    began_us = states["utime"][states["segment"] == under_way["segment"]][0]
    times = np.concatenate(list(dataset.start_us.values()))
    assert not np.any((times >= began_us) & (times < ends_us))
    assert all(len(np.unique(numbers)) == 1 for numbers in dataset.segments.values())
