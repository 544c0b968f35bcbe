"""Tests of one group run in one process: some share expensive fixtures, some use the same addresses."""

import os

import pytest


@pytest.mark.xdist_group("groups")
def test_the_group_of_a_test_is_known_to_the_scheduler(request):
    if "PYTEST_XDIST_WORKER" not in os.environ:
        pytest.skip("there is only one process")
    assert request.node.nodeid.endswith("@groups")
