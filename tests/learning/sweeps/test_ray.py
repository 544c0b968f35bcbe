"""A sweep on a Ray cluster of two nodes, which a process of its own starts."""

import subprocess
import sys

import pyarrow.parquet as pq
import pytest

CLUSTER = """
import sys
from ray.cluster_utils import Cluster
from hub.command_line.app import main

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
try:
    cluster.add_node(num_cpus=1)
    sys.argv = ["trocar", *sys.argv[1:], "--ray", cluster.address]
    main()
finally:
    cluster.shutdown()
"""


@pytest.mark.alone
def test_trials_on_two_nodes(scenario, tmp_path):
    output = tmp_path / "results"
    sweep = ["sweep", scenario, "--vary", "part.value=0,0.5", "-o", output]
    done = subprocess.run(
        [sys.executable, "-P", "-c", CLUSTER, *sweep], check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    rows = pq.read_table(output / "results.parquet").to_pylist()
    assert [(row["value"], row["state"], row["attempts"]) for row in rows] == [
        (0.0, "done", 1),
        (0.5, "done", 1),
    ]
