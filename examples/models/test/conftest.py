# SPDX-License-Identifier: Apache-2.0
"""The models as they are installed, without a simulation."""

from collections.abc import Callable

import pytest

from fcsl_sim.model_instance import ModelInstance


@pytest.fixture
def model() -> Callable[..., ModelInstance]:
    """An instance with these parameters, after init."""

    def make(name: str, **parameters: object) -> ModelInstance:
        made = ModelInstance.load(f"package://models/{name}")
        for parameter, value in parameters.items():
            made.set(f"parameters.{parameter}", value)
        made.init()
        return made

    return make
