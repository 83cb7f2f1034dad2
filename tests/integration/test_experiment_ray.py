"""The same experiment on a Ray cluster of two nodes; for installations that have Ray."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from twinscrew.hil_sim.experiments.plan import Experiment, SetSettings, parse_methods
from twinscrew.hil_sim.experiments.results import begin, results_sha256
from twinscrew.hil_sim.experiments.runner import run

ray = pytest.importorskip("ray", reason="needs twinscrew[ray]")
pytestmark = pytest.mark.filterwarnings("ignore")  # Ray's own


@pytest.fixture
def cluster() -> Iterator[None]:
    from ray.cluster_utils import Cluster

    head = {"num_cpus": 1, "include_dashboard": False}
    nodes = Cluster(initialize_head=True, head_node_args=head)
    nodes.add_node(num_cpus=1)
    ray.init(address=nodes.address, log_to_driver=False)
    assert len(ray.nodes()) == 2
    yield
    ray.shutdown()
    nodes.shutdown()


def test_two_nodes_give_what_this_process_gives(cluster: None, tmp_path: Path) -> None:
    sets = (SetSettings(name="head on", scenario="head_on"), SetSettings(name="two", vessels=2))
    asked = Experiment(methods=parse_methods("ac_iqn"), sets=sets, episodes=2, seed=3)
    digests = []
    for engine, jobs in (("ray", 2), ("local", 1)):
        begin(tmp_path / engine, asked)
        digests.append(results_sha256(run(asked, tmp_path / engine, jobs, engine).records))
    assert digests[0] == digests[1]
