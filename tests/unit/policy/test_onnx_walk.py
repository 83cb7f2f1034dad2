"""Foreign parts of an ONNX file are found wherever they hide, before anything of it is run."""

from collections.abc import Callable

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.onnx_walk import ALLOWED, refuse_foreign_parts

FLOAT = TensorProto.FLOAT


def tensor(*, external: bool) -> TensorProto:
    made = numpy_helper.from_array(np.ones(2, np.float32), "t")
    if external:
        made.ClearField("raw_data")
        made.data_location = TensorProto.EXTERNAL
        made.external_data.add(key="location", value="/etc/passwd")
    return made


def node(*, foreign: bool) -> onnx.NodeProto:
    if foreign:
        return helper.make_node("Shell", ["x"], ["y"], domain="evil")
    return helper.make_node("Identity", ["x"], ["y"])


def graph(nodes: list[onnx.NodeProto], **more: object) -> onnx.GraphProto:
    x, y = (helper.make_tensor_value_info(name, FLOAT, [2]) for name in "xy")
    return helper.make_graph(nodes, "g", [x], [y], **more)


def within_if(inner: onnx.GraphProto) -> onnx.NodeProto:
    return helper.make_node("If", ["c"], ["y"], then_branch=inner, else_branch=graph([]))


def function(nodes: list[onnx.NodeProto]) -> onnx.FunctionProto:
    return helper.make_function("", "f", ["x"], ["y"], nodes, [helper.make_opsetid("", 18)])


Place = Callable[[bool], onnx.ModelProto]
EXTERNAL: dict[str, Place] = {
    "an initializer": lambda bad: helper.make_model(
        graph([node(foreign=False)], initializer=[tensor(external=bad)])
    ),
    "a sparse initializer": lambda bad: helper.make_model(
        graph(
            [node(foreign=False)],
            sparse_initializer=[
                helper.make_sparse_tensor(tensor(external=bad), tensor(external=False), [4])
            ],
        )
    ),
    "an attribute": lambda bad: helper.make_model(
        graph([helper.make_node("Constant", [], ["y"], value=tensor(external=bad))])
    ),
    "a list in an attribute": lambda bad: helper.make_model(
        graph([helper.make_node("Constant", [], ["y"], value=[tensor(external=bad)])])
    ),
    "a graph in a graph in a graph": lambda bad: helper.make_model(
        graph([within_if(graph([within_if(graph([], initializer=[tensor(external=bad)]))]))])
    ),
    "a function": lambda bad: helper.make_model(
        graph([node(foreign=False)]),
        functions=[function([helper.make_node("Constant", [], ["y"], value=tensor(external=bad))])],
    ),
}
FOREIGN: dict[str, Place] = {
    "the graph": lambda bad: helper.make_model(graph([node(foreign=bad)])),
    "a graph in a graph": lambda bad: helper.make_model(
        graph([within_if(graph([node(foreign=bad)]))])
    ),
    "a function": lambda bad: helper.make_model(
        graph([node(foreign=False)]), functions=[function([node(foreign=bad)])]
    ),
    "a graph in a function": lambda bad: helper.make_model(
        graph([node(foreign=False)]), functions=[function([within_if(graph([node(foreign=bad)]))])]
    ),
}


@pytest.mark.parametrize("place", EXTERNAL)
def test_weights_in_another_file_are_refused_wherever_they_hide(place: str) -> None:
    refuse_foreign_parts(EXTERNAL[place](False).SerializeToString())
    with pytest.raises(PolicyError, match="another file"):
        refuse_foreign_parts(EXTERNAL[place](True).SerializeToString())


@pytest.mark.parametrize("place", FOREIGN)
def test_operators_outside_the_standard_are_refused_wherever_they_hide(place: str) -> None:
    refuse_foreign_parts(FOREIGN[place](False).SerializeToString())
    with pytest.raises(PolicyError, match="'Shell' of domain 'evil'"):
        refuse_foreign_parts(FOREIGN[place](True).SerializeToString())


@pytest.mark.parametrize(
    ("operator", "why"),
    [
        ("Loop", "never end"),
        ("Scan", "never end"),
        ("SequenceMap", "never end"),
        ("RandomNormal", "replay"),
        ("Dropout", "replay"),
        ("ImageDecoder", "not one of those that are known"),
        ("", "not one of those that are known"),
        ("OfNextYear", "not one of those that are known"),
    ],
)
@pytest.mark.parametrize(
    "place",
    [
        "the graph",
        "a graph in a graph",
        "a function",
        "what a function's attribute is by default",
        "how to train it",
    ],
)
def test_loops_and_chance_are_refused_wherever_they_hide(
    operator: str, why: str, place: str
) -> None:
    bad = helper.make_node(operator, ["x"], ["y"])
    made = {
        "the graph": lambda: helper.make_model(graph([bad])),
        "a graph in a graph": lambda: helper.make_model(graph([within_if(graph([bad]))])),
        "a function": lambda: helper.make_model(
            graph([node(foreign=False)]), functions=[function([bad])]
        ),
        "what a function's attribute is by default": lambda: by_default(bad),
        "how to train it": lambda: to_train(bad),
    }[place]()
    with pytest.raises(PolicyError, match=f"operator '{operator}': .*{why}"):
        refuse_foreign_parts(made.SerializeToString())


def by_default(bad: onnx.NodeProto) -> onnx.ModelProto:
    made = function([node(foreign=False)])
    made.attribute_proto.append(helper.make_attribute("branch", graph([bad])))
    return helper.make_model(graph([node(foreign=False)]), functions=[made])


def to_train(bad: onnx.NodeProto) -> onnx.ModelProto:
    made = helper.make_model(graph([node(foreign=False)]))
    made.training_info.add().algorithm.CopyFrom(graph([bad]))
    return made


def test_every_operator_that_is_allowed_is_one_of_the_standards() -> None:
    standard = {schema.name for schema in onnx.defs.get_all_schemas() if schema.domain == ""}
    assert standard >= ALLOWED


def test_no_operator_that_is_allowed_is_said_to_be_of_chance_by_the_standard() -> None:
    kinds = onnx.defs.OpSchema.NodeDeterminism.NonDeterministic
    chance = {s.name for s in onnx.defs.get_all_schemas() if s.node_determinism == kinds}
    assert chance
    assert chance & ALLOWED == {"If"}  # what is in its branches is looked at, too


def test_where_weights_lie_is_refused_even_if_the_file_says_that_they_are_here() -> None:
    liar = tensor(external=True)
    liar.data_location = TensorProto.DEFAULT
    made = helper.make_model(graph([node(foreign=False)], initializer=[liar]))
    with pytest.raises(PolicyError, match="another file"):
        refuse_foreign_parts(made.SerializeToString())


def test_graphs_without_end_are_refused() -> None:
    deep = graph([node(foreign=False)])
    for _ in range(20):
        deep = graph([within_if(deep)])
    with pytest.raises(PolicyError, match="nested too deep"):
        refuse_foreign_parts(helper.make_model(deep).SerializeToString())
