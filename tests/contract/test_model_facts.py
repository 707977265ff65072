"""Facts about a model survive the wire; incomplete ones say so."""

import io
from dataclasses import replace

import numpy as np
import pytest

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.envelope import Envelope
from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.messages import Message, read_message, write_message
from pe_runtime.contract.model_facts import ModelFacts, Volume

CAMERA = Camera(64, 36, np.array([[50.0, 0, 32], [0, 50, 18], [0, 0, 1]]), np.eye(4))
FACTS = ModelFacts(
    "duel",
    {"b": ("idle", "left"), "a": ("idle",), "c": ()},
    5.0,
    256,
    144,
    resting_actions={"b": 1, "a": 0},
    turning_names=("a",),
    volumes={"b": Volume((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0))},
    usual_camera=CAMERA,
    licence="CC BY 4.0",
    movements={"b": ((0.0, 0.0), (-0.3, 0.1)), "a": ((0.0, 0.0),), "c": ()},
    envelope=Envelope(
        ((-3.0, -2.0), (3.0, 2.5)), (1.0, 3.0), (6.0, 11.0), (-20.0, -4.0), (47.0, 53.0), (0.2, 0.7)
    ),
    detects=True,
    device="cuda: NVIDIA H100",
    digest="ab" * 32,
)


def through_the_wire(facts):
    stream = io.BytesIO()
    write_message(stream, Message("ready", facts.as_fields()))
    stream.seek(0)
    return ModelFacts.from_fields(read_message(stream).fields)


def test_facts_come_back_from_a_message_in_the_models_order():
    back = through_the_wire(FACTS)
    assert back == FACTS
    assert back.playable_names == ("b", "a", "c")


def test_a_model_may_have_no_usual_camera():
    assert through_the_wire(replace(FACTS, usual_camera=None)).usual_camera is None


def test_nobody_need_know_what_a_model_was_trained_on():
    assert through_the_wire(replace(FACTS, envelope=None)).envelope is None


@pytest.mark.parametrize("fact", [*FACTS.as_fields()])
def test_a_missing_fact_is_a_clear_error(fact):
    fields = FACTS.as_fields()
    del fields[fact]
    with pytest.raises(WorkerError, match=f"{fact}.*the same version"):
        ModelFacts.from_fields(fields)


@pytest.mark.parametrize(
    "wrong",
    [
        {"volumes": {"b": [[0, 0, 0]]}},
        {"volumes": {"b": [[0, 0, 0], [1, 1]]}},
        {"volumes": {"b": [[0, 0, 0], [1, 1, float("nan")]]}},
        {"volumes": [1]},
        {"resting_actions": {"b": "left"}},
        {"usual_camera": {"width": 2}},
        {"movements": {"b": [[0.0]]}},
        {"movements": [[0.0, 1.0]]},
        {"envelope": {}},
        {"envelope": FACTS.envelope.as_dict() | {"box_heights": [2.0, 1.0]}},
        {"action_names": {}},
        {"width": None},
    ],
    ids=str,
)
def test_a_malformed_fact_is_a_clear_error(wrong):
    with pytest.raises(WorkerError, match="incomplete"):
        ModelFacts.from_fields(FACTS.as_fields() | wrong)
