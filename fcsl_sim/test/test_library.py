# SPDX-License-Identifier: Apache-2.0
"""The library of models as a whole: every model is documented, describes itself, and flies with the others."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fcsl_sim.model_instance import ModelInstance
from simclient import SimTwin

ROOT = Path(__file__).resolve().parents[2]
MODELS = sorted((ROOT / "fcsl_sim/models").glob("*.c"))
PAGE = (ROOT / "docs/reference/model_library.md").read_text()
AIRCRAFT = Path(__file__).with_name("library") / "aircraft.sim.json"
#: Described elsewhere: a sensor of anything, in the pages of models; a line, in that of the simulator.
ELSEWHERE = ("noisy_sensor", "serial_link")
#: Of anything, whatever its unit.
OF_ANYTHING = (*ELSEWHERE, "sine_injection", "sine_injection_vector")
#: Quantities without a unit.
PLAIN = re.compile(
    r"attitude|vector_|scale_error|coefficient|probability|delay_samples|fault|sampled|touching|saturated|burnt_out|mach$|throttle"
    r"|lift|drag|moment$|_from_|cl[pr]|cmq|cnr|charge|cells|direction|axis|beam|points|friction$|flattening|damping|motor_reacts"
    r"|soft_iron|decimal_year|position_body|slip_"
)


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_a_model_describes_itself(path: Path) -> None:
    model = ModelInstance.load(str(path))
    assert 10 < len(model.doc) < 120 and not model.doc.endswith(".")
    ports = [field for field in model.fields.values() if field.role != "state"]
    without = [field.path for field in ports if not field.unit and not PLAIN.search(field.path)]
    assert without == [] or path.stem in OF_ANYTHING
    text = path.read_text()
    assert text.startswith("/* SPDX-License-Identifier: Apache-2.0\n *\n * ")


@pytest.mark.parametrize("name", [path.stem for path in MODELS if path.stem not in ELSEWHERE])
def test_a_model_has_a_section_with_sources_and_limits(name: str) -> None:
    (section,) = [part for part in re.split(r"(?m)^### ", PAGE) if f"`{name}`" in part.partition("\n")[0]]
    assert "- Source: " in section and "- Limits: " in section


def test_models_that_are_named_exist() -> None:
    headings = " ".join(re.findall(r"(?m)^### (.*)$", PAGE))
    named = set(re.findall(r"`(\w+)`", headings))
    assert named <= {path.stem for path in MODELS}


def test_the_library_flies_together() -> None:
    """Purity and feed-through of nearly every model are tried when it begins; a checkpoint goes on bit for bit."""
    with SimTwin.from_config(AIRCRAFT) as twin:
        twin.tick(150)
        saved = twin.save()
        twin.tick(150)
        paths = [
            f"{name}.{field.path}" for name, table in twin.config.tables.items() for field in table.of_role("output")
        ]
        last = twin.get_many(paths)
        twin.restore(saved)
        twin.tick(150)
        assert twin.get_many(paths) == last
        used = {table.name for table in twin.config.tables.values()}
    missing = {path.stem for path in MODELS} - used
    assert missing == {*OF_ANYTHING, "earth_round", "earth_wgs84", "rigid_body_geodetic"}
