"""Policy files: what a good one answers, and that each kind of bad one is refused by name."""

import hashlib
import importlib.util
import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.messages.types import Observation
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.policy.metadata import PolicyExpectation
from twinscrew.runtime.policy.onnx import OnnxPolicy
from twinscrew.runtime.policy.risk import RiskSettings

_spec = importlib.util.spec_from_file_location("graphs", Path(__file__).with_name("graphs.py"))
graphs = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(graphs)


def observation(ego=(0.0,) * 7):
    return Observation(
        ego=np.array(ego, dtype=np.float32),
        objects=np.zeros((5, 5), dtype=np.float32),
        mask=np.zeros(5, dtype=np.float32),
    )


def ahead(x, y=0.0):
    return observation((x, y, 0, 0, 0, 0, 0))


def with_metadata(**changes):
    changed = {**graphs.METADATA, **changes}
    return {key: value for key, value in changed.items() if value is not None}


def refused(folder, words, expect=None, **parts):
    path = graphs.save(folder, **parts)
    with pytest.raises(PolicyError) as error:
        OnnxPolicy(path, expect)
    message = str(error.value)
    assert message.startswith(str(path))
    for word in words:
        assert word in message


def test_a_good_file_answers_with_newtons_per_second(tmp_path):
    policy = OnnxPolicy(graphs.save(tmp_path))
    rate = policy.act(ahead(20.0, -3.0))
    assert rate.dtype == np.float64
    assert rate == pytest.approx([200.0, -30.0])


def test_a_policy_file_is_a_policy(tmp_path):
    policy = OnnxPolicy(graphs.save(tmp_path))
    assert isinstance(policy, Policy)
    assert (policy.name, policy.period_s) == ("hand_made", 0.5)


def test_answers_are_clipped_to_the_greatest_rate(tmp_path):
    policy = OnnxPolicy(graphs.save(tmp_path))
    assert policy.act(ahead(500.0, -500.0)).tolist() == [1000.0, -1000.0]


def test_an_answer_is_not_overwritten_by_the_next(tmp_path):
    policy = OnnxPolicy(graphs.save(tmp_path))
    first = policy.act(ahead(1.0))
    policy.act(ahead(2.0))
    assert first.tolist() == [10.0, 0.0]


def test_the_hash_is_that_of_the_file(tmp_path):
    path = graphs.save(tmp_path)
    assert OnnxPolicy(path).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_an_answer_that_is_not_finite_is_an_error(tmp_path):
    zero = helper.make_tensor("zero", TensorProto.FLOAT, [2], [0.0, 0.0])
    nodes, tensors = graphs.goal_times_ten()
    nodes[-1].output[0] = "scaled"
    # log(goal + 1) is finite at rest and minus infinity where the goal is 1 m behind.
    one = helper.make_tensor("one", TensorProto.FLOAT, [1], [1.0])
    nodes = [
        nodes[0],
        helper.make_node("Add", ["goal", "one"], ["sum"]),
        helper.make_node("Log", ["sum"], ["log"]),
        helper.make_node("Add", ["log", "zero"], ["thrust_rate"]),
    ]
    policy = OnnxPolicy(graphs.save(tmp_path, nodes=nodes, initializers=[*tensors[:3], zero, one]))
    with pytest.raises(PolicyError, match="not finite"):
        policy.act(ahead(-1.0))


def test_an_observation_that_is_not_finite_is_an_error(tmp_path):
    with pytest.raises(PolicyError, match="observation is not finite"):
        OnnxPolicy(graphs.save(tmp_path)).act(ahead(float("nan")))


def test_an_output_of_another_shape_is_refused(tmp_path):
    nodes = [helper.make_node("Identity", ["mask"], ["thrust_rate"])]
    loose = helper.make_tensor_value_info("thrust_rate", TensorProto.FLOAT, ["N", "M"])
    refused(tmp_path, ["thrust_rate", "['N', 5]", "['N', 2]"], nodes=nodes, output=loose)


def test_an_answer_whose_shape_is_not_what_the_file_declares_is_refused(tmp_path):
    # Compress keeps the columns of ego that are not negative: at rest, all seven.
    zero = helper.make_tensor("zero", TensorProto.FLOAT, [1], [0.0])
    flat = helper.make_tensor("flat", TensorProto.INT64, [1], [-1])
    nodes = [
        helper.make_node("GreaterOrEqual", ["ego", "zero"], ["positive"]),
        helper.make_node("Reshape", ["positive", "flat"], ["columns"]),
        helper.make_node("Compress", ["ego", "columns"], ["thrust_rate"], axis=1),
    ]
    refused(tmp_path, ["(1, 7)", "at rest"], nodes=nodes, initializers=[zero, flat])


def test_a_graph_that_asks_for_a_risk_level_is_given_it(tmp_path):
    inputs = [graphs.float_input(name) for name in ("ego", "objects", "mask", "risk")]
    nodes = [helper.make_node("Concat", ["risk", "risk"], ["thrust_rate"], axis=1)]
    path = graphs.save(tmp_path, nodes=nodes, inputs=inputs)
    quarter = OnnxPolicy(path, risk=RiskSettings(level=0.25))
    assert quarter.act(observation()).tolist() == [0.25, 0.25]
    assert OnnxPolicy(path).act(observation()).tolist() == [1.0, 1.0]


def echo_of_risk(folder, default=0.5):
    """A graph that answers with its risk level, which it has a default for."""
    inputs = [graphs.float_input(name) for name in ("ego", "objects", "mask", "risk")]
    initial = helper.make_tensor("risk", TensorProto.FLOAT, [1, 1], [default])
    nodes = [helper.make_node("Concat", ["risk", "risk"], ["thrust_rate"], axis=1)]
    return graphs.save(folder, nodes=nodes, inputs=inputs, initializers=[initial])


def test_a_graph_with_a_default_level_keeps_it_unless_another_is_set(tmp_path):
    path = echo_of_risk(tmp_path)
    assert OnnxPolicy(path).act(observation()).tolist() == [0.5, 0.5]
    quarter = OnnxPolicy(path, risk=RiskSettings(level=0.25))
    assert quarter.act(observation()).tolist() == [0.25, 0.25]


def test_an_adaptive_level_follows_what_is_near(tmp_path):
    adaptive = RiskSettings(level="adaptive", floor=0.2, distance_m=10.0, own_radius_m=3.0)
    policy = OnnxPolicy(echo_of_risk(tmp_path), risk=adaptive)
    near = observation()
    near.objects[0], near.mask[0] = (0.0, 9.0, 0.0, 0.0, 1.0), 1.0  # a gap of 5 m
    assert policy.act(near).tolist() == pytest.approx([0.6, 0.6])
    assert policy.act(observation()).tolist() == [1.0, 1.0]


@pytest.mark.parametrize("level", [0.5, "adaptive"])
def test_a_level_is_refused_by_a_policy_that_takes_none(tmp_path, level):
    with pytest.raises(PolicyError, match="takes no risk level"):
        OnnxPolicy(graphs.save(tmp_path), risk=RiskSettings(level=level))


def test_an_initializer_that_could_be_fed_but_is_no_input_of_a_policy_is_refused(tmp_path):
    nodes, tensors = graphs.goal_times_ten()
    named = [graphs.float_input(name) for name in ("ego", "objects", "mask")]
    ten = helper.make_tensor_value_info("ten", TensorProto.FLOAT, [1])
    refused(tmp_path, ["'ten'", "risk"], nodes=nodes, initializers=tensors, inputs=[*named, ten])


@pytest.mark.parametrize("key", graphs.METADATA)
def test_each_metadata_key_is_needed(tmp_path, key):
    refused(tmp_path, [repr(key), "missing"], metadata=with_metadata(**{key: None}))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("twinscrew_format", "2"),
        ("algorithm", ""),
        ("decision_period_s", "soon"),
        ("decision_period_s", "0"),
        ("decision_period_s", "nan"),
        ("thrust_min_n", "5"),
        ("thrust_min_n", "-inf"),
        ("thrust_max_n", "-1"),
        ("thrust_max_n", "inf"),
        ("thrust_rate_max_n_per_s", "0"),
        ("observed_objects", "0"),
        ("observed_objects", "33"),
        ("perception_range_m", "-20"),
        ("inputs", "not json"),
        ("inputs", "[]"),
        ("inputs", json.dumps({"ego": graphs.INPUTS["ego"]})),
        ("inputs", json.dumps({**graphs.INPUTS, "mask": 5})),
        ("inputs", json.dumps({**graphs.INPUTS, "mask": {"shape": ["N", 5]}})),
        ("inputs", json.dumps({**graphs.INPUTS, "ego": {**graphs.INPUTS["ego"], "shape": [1]}})),
    ],
)
def test_metadata_that_is_out_of_range_is_refused(tmp_path, key, value):
    refused(tmp_path, ["metadata", key], metadata=with_metadata(**{key: value}))


def test_metadata_that_are_no_text_are_refused_and_nothing_is_printed(tmp_path, capfd):
    path = graphs.save(tmp_path, metadata=with_metadata(algorithm="no text"))
    path.write_bytes(path.read_bytes().replace(b"no text", b"no \xfftxt"))
    with pytest.raises(PolicyError, match=f"{path}: "):
        OnnxPolicy(path)
    assert capfd.readouterr() == ("", "")


def test_a_graph_whose_names_are_no_text_is_refused_and_nothing_is_printed(tmp_path, capfd):
    path = graphs.save(tmp_path)
    path.write_bytes(path.read_bytes().replace(b"thrust_rate", b"thr\xffst_rate"))
    with pytest.raises(PolicyError, match=f"{path}: "):
        OnnxPolicy(path)
    assert capfd.readouterr() == ("", "")


def test_metadata_that_is_not_known_is_ignored(tmp_path):
    path = graphs.save(tmp_path, metadata=with_metadata(author="somebody"))
    assert OnnxPolicy(path).name == "hand_made"


@pytest.mark.parametrize(
    ("expect", "values"),
    [
        (PolicyExpectation(thrust_max_n=800.0), ["thrust_max_n", "1000", "800"]),
        (PolicyExpectation(thrust_min_n=-400.0), ["thrust_min_n", "-500", "-400"]),
        (PolicyExpectation(perception_range_m=15.0), ["perception_range_m", "20", "15"]),
    ],
)
def test_a_policy_for_another_vessel_is_refused(tmp_path, expect, values):
    refused(tmp_path, values, expect=expect)


@pytest.mark.parametrize("range_m", [20.0, 60.0])
def test_a_policy_for_this_vessel_is_taken_and_shown_no_more_than_it_knows(tmp_path, range_m):
    expect = PolicyExpectation(thrust_min_n=-500.0, thrust_max_n=1000.0, perception_range_m=range_m)
    policy = OnnxPolicy(graphs.save(tmp_path), expect)
    assert policy.name == "hand_made"
    assert policy.shown.range_m == 20.0


def test_a_policy_that_learnt_to_see_less_far_is_taken(tmp_path):
    ranges = with_metadata(perception_range_m="60", perception_range_min_m="20")
    path = graphs.save(tmp_path, metadata=ranges)
    assert OnnxPolicy(path, PolicyExpectation(perception_range_m=20.0)).shown.range_m == 60.0
    with pytest.raises(PolicyError, match="perception_range_min_m"):
        OnnxPolicy(path, PolicyExpectation(perception_range_m=19.0))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ([("ego", [8])], ["'ego'", "8", "7"]),
        ([("objects", [6, 5])], ["'objects'", "6", "[", "5"]),
        ([("mask", [5, 1])], ["'mask'"]),
    ],
)
def test_inputs_of_another_shape_are_refused(tmp_path, changed, words):
    shapes = {**{name: graphs.SHAPES[name] for name in graphs.INPUTS}, **dict(changed)}
    inputs = [graphs.float_input(name, shape) for name, shape in shapes.items()]
    refused(tmp_path, ["shape", *words], inputs=inputs)


def test_inputs_of_another_type_are_refused(tmp_path):
    inputs = [graphs.float_input("ego"), graphs.float_input("objects")]
    inputs.append(graphs.float_input("mask", kind=TensorProto.BOOL))
    refused(tmp_path, ["'mask'", "tensor(bool)", "tensor(float)"], inputs=inputs)


def test_a_missing_input_is_refused(tmp_path):
    inputs = [graphs.float_input("ego"), graphs.float_input("objects")]
    refused(tmp_path, ["'mask' is missing"], inputs=inputs)


def test_an_unknown_input_is_refused(tmp_path):
    inputs = [graphs.float_input(name) for name in graphs.INPUTS]
    inputs.append(graphs.float_input("weather", [3]))
    refused(tmp_path, ["'weather'", "ego, objects, mask"], inputs=inputs)


def test_another_output_is_refused(tmp_path):
    nodes, tensors = graphs.goal_times_ten()
    nodes[-1].output[0] = "thrust"
    output = helper.make_tensor_value_info("thrust", TensorProto.FLOAT, ["N", 2])
    refused(tmp_path, ["thrust", "thrust_rate"], nodes=nodes, initializers=tensors, output=output)


def test_operators_outside_the_standard_are_refused(tmp_path):
    nodes, tensors = graphs.goal_times_ten()
    nodes[1] = helper.make_node("Gelu", ["goal"], ["thrust_rate"], domain="com.microsoft")
    opsets = [helper.make_opsetid("", 18), helper.make_opsetid("com.microsoft", 1)]
    refused(
        tmp_path, ["'Gelu'", "com.microsoft"], nodes=nodes, initializers=tensors[:3], opsets=opsets
    )


def test_weights_in_another_file_are_refused(tmp_path):
    path = tmp_path / "policy.onnx"
    made = graphs.model()
    weight = np.zeros(4096, dtype=np.float32)
    made.graph.initializer.append(onnx.numpy_helper.from_array(weight, "unused"))
    onnx.save(made, path, save_as_external_data=True, location="weights.bin", size_threshold=0)
    with pytest.raises(PolicyError, match="another file"):
        OnnxPolicy(path)


@pytest.mark.parametrize("keep", [0, 1, 10, 200, -1])
def test_a_file_cut_short_is_refused(tmp_path, keep):
    path = graphs.save(tmp_path)
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(PolicyError, match=str(path)):
        OnnxPolicy(path)


def test_a_file_that_is_no_model_is_refused(tmp_path):
    path = tmp_path / "policy.onnx"
    path.write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(PolicyError, match=str(path)):
        OnnxPolicy(path)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(PolicyError, match="No such file"):
        OnnxPolicy(tmp_path / "none.onnx")


CONTOUR = {"units": ["m"], "frame": "B", "shape": ["N", 32], "range_m": 40.0}


def contour_default():
    return helper.make_tensor("contour", TensorProto.FLOAT, [1, 32], [40.0] * 32)


def with_contour(**changes):
    """A graph that takes a contour which it may be left without, and metadata that say so."""
    nodes, tensors = graphs.goal_times_ten()
    names = ("ego", "objects", "mask")
    return {
        "nodes": nodes,
        "initializers": [*tensors, contour_default()],
        "inputs": [
            *(graphs.float_input(name) for name in names),
            helper.make_tensor_value_info("contour", TensorProto.FLOAT, [1, 32]),
        ],
        "metadata": with_metadata(
            inputs=json.dumps({**graphs.INPUTS, "contour": {**CONTOUR, **changes}})
        ),
    }


def test_a_file_that_takes_a_contour_is_shown_it(tmp_path):
    policy = OnnxPolicy(graphs.save(tmp_path, **with_contour()))
    assert policy.shown.contour_m == 40.0


def test_metadata_that_tell_of_a_contour_otherwise_than_the_graph_are_refused(tmp_path):
    told = {"metadata": with_contour()["metadata"]}
    refused(tmp_path, ["'contour'", "in its metadata", "not in its graph"], **told)
    untold = {**with_contour(), "metadata": graphs.METADATA}
    refused(tmp_path, ["'contour'", "in its graph", "not in its metadata"], **untold)


def test_a_contour_of_another_range_is_refused(tmp_path):
    refused(tmp_path, ["inputs.contour.range_m", "25", "40"], **with_contour(range_m=25))
