"""A sweep on a Ray cluster of two nodes, which a process of its own starts."""

import subprocess
import sys

import pyarrow.parquet as pq
import pytest

CLUSTER = """
import subprocess, sys
from ray.cluster_utils import Cluster

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
try:
    cluster.add_node(num_cpus=1)
    done = subprocess.run([*sys.argv[1:], "--ray", cluster.address], check=False)
finally:
    cluster.shutdown()
sys.exit(done.returncode)
"""


@pytest.mark.xdist_group("ray")
def test_the_same_trials_on_two_nodes(scenario, tmp_path):
    sweep = [sys.executable, "-m", "trocar", "sweep", scenario, "--vary", "part.value=0,0.5"]
    here, there = tmp_path / "here", tmp_path / "there"
    subprocess.run([*sweep, "-o", here], check=True, capture_output=True)
    done = subprocess.run(
        [sys.executable, "-c", CLUSTER, *sweep, "-o", there], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    columns = ["trial", "part.value", "value", "state", "state_hash", "attempts"]
    assert (
        pq.read_table(there / "results.parquet")
        .select(columns)
        .equals(pq.read_table(here / "results.parquet").select(columns))
    )
