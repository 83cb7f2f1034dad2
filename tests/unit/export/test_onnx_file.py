import json

import msgspec
import onnx
import onnxruntime
import pytest
import torch

from twinscrew.export.onnx_file import (
    OPSET,
    DeployedPolicy,
    example_inputs,
    inputs_of,
    onnx_bytes,
)
from twinscrew.runtime.charts.contour import CONTOUR_RANGE_M, SECTORS
from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.onnx import graph_inputs
from twinscrew.runtime.policy.onnx_walk import refuse_foreign_parts
from twinscrew.training.networks import Actor, Beside, NetworkSettings, Pilot, See, circles
from twinscrew.training.perception import PAPER, Layout

EXTENDED = Layout(8, extended=True)
EDGED = Layout(8, extended=True, contour=True)
SMALL = NetworkSettings(ego_width=16, object_width=16, hidden_width=16)
AS_PUBLISHED = NetworkSettings(kind="paper", normalise=False, hidden_width=16)
OUTLINED = NetworkSettings(kind="outlined", ego_width=16, object_width=16, hidden_width=16)


def policy(margin=1.25, settings=SMALL):
    torch.manual_seed(0)
    return DeployedPolicy(Pilot(See(settings), Actor(settings), margin), 1000.0)


@pytest.fixture(scope="module", params=[SMALL, AS_PUBLISHED], ids=["set", "paper"])
def exported(request):
    made = policy(settings=request.param)
    return made, onnx_bytes(made, {"algorithm": "ac_iqn", "answer": "42"})


def quiet():
    """Session options without the note that an input has a default."""
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    return options


def answers(data, inputs, risk=None):
    session = onnxruntime.InferenceSession(data, quiet(), providers=["CPUExecutionProvider"])
    names = ("ego", "objects", "mask", "outlines", "hull", "contour")
    taken = {node.name for node in graph_inputs(session)}
    feed = {n: part.numpy() for n, part in zip(names, inputs, strict=False) if n in taken}
    if risk is not None:
        feed["risk"] = risk.numpy()
    return torch.from_numpy(session.run(["thrust_rate"], feed)[0])


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 33])
def test_the_graph_answers_as_the_network_for_any_batch(exported, count):
    made, data = exported
    inputs = example_inputs(count, seed=count)
    with torch.no_grad():
        assert torch.allclose(answers(data, inputs), made(*inputs), atol=0.02)


def test_padding_has_no_influence_in_the_graph(exported):
    _, data = exported
    ego, objects, mask, *_ = example_inputs(20, seed=3)
    dirty = torch.where(mask[:, :, None] > 0, objects, 1e6)
    assert torch.equal(answers(data, (ego, objects, mask)), answers(data, (ego, dirty, mask)))


def test_thrust_rates_keep_within_the_limit(exported):
    _, data = exported
    ego, objects, mask, *_ = example_inputs(200, seed=4)
    assert answers(data, (ego * 100, objects, mask)).abs().max() <= 1000.0


def test_the_graph_is_opset_18_and_stands_alone(exported):
    _, data = exported
    model = onnx.load_from_string(data)
    assert [(o.domain, o.version) for o in model.opset_import] == [("", OPSET)]
    refuse_foreign_parts(data)


def test_inputs_and_output_have_their_names_and_shapes(exported):
    _, data = exported
    graph = onnx.load_from_string(data).graph

    def shape(value):
        return [d.dim_param or d.dim_value for d in value.type.tensor_type.shape.dim]

    found = {value.name: shape(value) for value in graph.input}
    assert found == {name: told["shape"] for name, told in inputs_of(PAPER, None).items()}
    assert {v.name: shape(v) for v in graph.output} == {"thrust_rate": ["N", 2]}


def test_metadata_is_in_the_file_and_nothing_of_this_machine(exported):
    _, data = exported
    model = onnx.load_from_string(data)
    assert {p.key: p.value for p in model.metadata_props} == {"algorithm": "ac_iqn", "answer": "42"}
    assert b"site-packages" not in data
    assert b"encoders.py" not in data


def test_the_margin_widens_what_is_seen():
    inputs = example_inputs(50, seed=5)
    wide = inputs._replace(objects=inputs.objects * torch.tensor([1, 1, 1, 1, 1.25]))
    with torch.no_grad():
        assert torch.allclose(policy(1.25)(*inputs), policy(1.0)(*wide), atol=1e-3)
        assert not torch.allclose(policy(1.25)(*inputs), policy(1.0)(*inputs), atol=1e-3)


def test_metadata_must_be_strings():
    with pytest.raises(PolicyError, match=r"'period' must be a string, got 0\.5"):
        onnx_bytes(policy(), {"period": 0.5})


@pytest.fixture(scope="module", params=[SMALL, AS_PUBLISHED], ids=["set", "paper"])
def conditioned(request):
    torch.manual_seed(1)
    actor = Actor(request.param, extra=1)
    made = DeployedPolicy(Pilot(See(request.param), actor, 1.25, risk=0.5), 1000.0)
    return made, onnx_bytes(made, {"algorithm": "ac_iqn"})


@pytest.mark.slow
def test_a_risk_level_may_be_left_out_and_is_not_asked_for(conditioned):
    made, data = conditioned
    inputs = example_inputs(5, seed=5)
    session = onnxruntime.InferenceSession(data, quiet(), providers=["CPUExecutionProvider"])
    assert [node.name for node in session.get_inputs()] == ["ego", "objects", "mask"]
    with torch.no_grad():
        half = made(*inputs, risk=torch.full((5, 1), 0.5))
    assert torch.allclose(answers(data, inputs), half, atol=0.02)


@pytest.mark.parametrize("count", [1, 2, 33])
def test_every_row_may_have_a_risk_level_of_its_own(conditioned, count):
    made, data = conditioned
    inputs, risk = example_inputs(count, seed=6), torch.linspace(0.1, 1.0, count)[:, None]
    with torch.no_grad():
        expected = made(*inputs, risk=risk)
    assert torch.allclose(answers(data, inputs, risk), expected, atol=0.02)
    assert not torch.equal(answers(data, inputs), answers(data, inputs, risk))


@pytest.fixture(scope="module")
def outlined():
    torch.manual_seed(2)
    made = DeployedPolicy(Pilot(See(OUTLINED), Actor(OUTLINED, extra=1), 1.25, risk=0.5), 1000.0)
    return made, onnx_bytes(made, {"algorithm": "ac_iqn"}, EXTENDED)


@pytest.mark.parametrize("count", [1, 2, 33])
def test_outlines_and_a_hull_of_every_row_s_own_are_heeded(outlined, count):
    made, data = outlined
    inputs = example_inputs(count, 7, EXTENDED)
    with torch.no_grad():
        assert torch.allclose(answers(data, inputs), made(*inputs), atol=0.02)
    other = inputs._replace(hull=inputs.hull * 1.5)
    assert not torch.equal(answers(data, inputs), answers(data, other))


def test_who_feeds_no_outlines_and_no_hull_has_circles_and_the_default_vessel(outlined):
    made, data = outlined
    inputs = example_inputs(9, 8, EXTENDED)
    session = onnxruntime.InferenceSession(data, quiet(), providers=["CPUExecutionProvider"])
    assert [node.name for node in session.get_inputs()] == ["ego", "objects", "mask"]
    with torch.no_grad():
        plain = made(*circles(*inputs[:3]))
    assert torch.allclose(answers(data, inputs[:3]), plain, atol=0.02)


def test_padding_has_no_influence_among_outlines(outlined):
    _, data = outlined
    ego, objects, mask, outlines, hull, *_ = example_inputs(20, 9, EXTENDED)
    there = mask[:, :, None] > 0
    dirty = torch.where(there, objects, 1e6), mask, torch.where(there, outlines, 50.0)
    clean = answers(data, (ego, objects, mask, outlines, hull))
    assert torch.equal(clean, answers(data, (ego, *dirty, hull)))


# -- a policy that is shown what is fixed ---------------------------------------------------------


@pytest.fixture(scope="module")
def edged():
    """Give a policy of two actors, one of which sees edges, and its file."""
    torch.manual_seed(1)
    sees = msgspec.structs.replace(OUTLINED, contour=True, contour_width=16)
    edges = Actor(sees)
    torch.nn.init.normal_(edges.encoder.contour.out.weight)  # as if it had learnt something
    pilot = Pilot(See(sees), Beside(Actor(OUTLINED), edges), 1.25)
    made = DeployedPolicy(pilot, 1000.0)
    inputs = inputs_of(EDGED, None, any_hull=True)
    return made, onnx_bytes(made, {"inputs": json.dumps(inputs)}, EDGED)


@pytest.mark.parametrize("count", [1, 33])
def test_every_row_s_contour_is_heeded(edged, count):
    made, data = edged
    seen = example_inputs(count, count, EDGED)
    with torch.no_grad():
        assert torch.allclose(answers(data, seen), made(*seen), atol=0.02)
        closer = seen._replace(contour=seen.contour / 4.0)
        assert torch.allclose(answers(data, closer), made(*closer), atol=0.02)
    assert not torch.allclose(answers(data, seen), answers(data, closer), atol=1.0)


def test_who_feeds_no_contour_has_nothing_fixed(edged):
    _, data = edged
    seen = example_inputs(5, 3, EDGED)
    nothing = seen._replace(contour=torch.full((5, SECTORS), CONTOUR_RANGE_M))
    assert torch.equal(answers(data, seen[:5]), answers(data, nothing))


def test_where_no_edge_is_near_it_acts_as_the_policy_without_a_contour(edged):
    made, _ = edged
    blind = DeployedPolicy(Pilot(See(OUTLINED), made.pilot.actor.open_water, 1.25), 1000.0)
    seen = example_inputs(9, 4, EXTENDED)
    with torch.no_grad():
        assert torch.equal(made(*seen), blind(*seen))
