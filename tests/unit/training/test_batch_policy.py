"""Policy files asked with many rows at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.training.evaluate import open_policy
from twinscrew.training.perception import Observations


def test_a_policy_for_one_row_only_is_refused_with_what_it_was_asked(tmp_path: Path) -> None:
    model = onnx.load(CONFIG_DIR / "policies" / "ac_iqn_wam_v.onnx")
    for given in model.graph.input:
        given.type.tensor_type.shape.dim[0].dim_value = 1
    onnx.save(model, tmp_path / "one.onnx")
    policy = open_policy(str(tmp_path / "one.onnx"))
    blank = Observations.of(
        ego=np.zeros((1, 3, 7), np.float32),
        objects=np.zeros((1, 3, 5, 5), np.float32),
        mask=np.zeros((1, 3, 5), np.float32),
    )
    assert policy.rates(blank, np.array([[True, False, False]])).shape == (1, 3, 2)
    with pytest.raises(PolicyError, match="ac_iqn failed with 3 rows at once"):
        policy.rates(blank, np.ones((1, 3), bool))
