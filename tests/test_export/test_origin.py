"""What an FMU says of its making: the device's name, the day, records and intervals, the report."""

import time
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
import tomli_w

from bender_export import build
from bender_export.assembly import plant_parts
from bender_export.origin import device_name, facts_of, generation_date
from bender_loop.errors import InputError
from bender_native.description import fmi3_description
from bender_plant.model import Model, ModelError, load_model, model_from_table
from bender_plant.origin import Origin
from bender_plant.valid_range import ValidRange

ORIGIN = Origin(("monday.csv", "tuesday.csv"), ("gain: 0.95 ± 0.01 (95 %)",), "W", "K", report="report.html")


@pytest.fixture
def oven() -> Model:
    return replace(load_model("beam"), name="oven 3", valid=ValidRange(0.0, 400.0, 3600.0), origin=ORIGIN)


def test_the_date_is_that_of_the_day_or_the_one_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    made = time.mktime(time.strptime(generation_date(), "%Y-%m-%dT%H:%M:%SZ")) - time.timezone
    assert abs(made - time.time()) < 60.0
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert generation_date() == "1970-01-02T00:00:00Z"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(InputError, match="SOURCE_DATE_EPOCH: found 'yesterday', expected a whole number of seconds"):
        generation_date()


def test_the_model_file_carries_its_origin(oven: Model) -> None:
    assert model_from_table(oven.to_table()) == oven


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        ({"records": "one.csv"}, r"origin\.records: found 'one\.csv', expected a list of texts"),
        ({"report": "../secret"}, r"origin\.report: found '\.\./secret', expected the name of a file beside"),
        ({"author": "me"}, r"origin\.author: unknown key"),
    ],
)
def test_an_origin_that_cannot_be_is_refused(origin: dict[str, object], said: str) -> None:
    with pytest.raises(ModelError, match=said):
        model_from_table(load_model("paper").to_table() | {"origin": origin})


def test_an_fmu_is_called_as_the_device(oven: Model) -> None:
    assert [device_name(load_model(x)) for x in ("paper", "beam")] == ["PiezoBender", "PiezoBender"]
    description, page, _ = plant_parts(oven, "{0}")
    assert ElementTree.fromstring(fmi3_description("PiezoBender", description)).get("modelName") == "oven 3"
    text = page.decode()
    for said in ("<h1>oven 3</h1>", "monday.csv", "0 to 400 W over 3600 s", "0.95 ± 0.01", 'href="report.html"'):
        assert said in text
    assert ("Units", ("1 V of the command stands for 1 W", "1 um of the reading stands for 1 K")) in facts_of(oven)


def test_what_was_not_learned_says_nothing_of_records() -> None:
    page = plant_parts(load_model("paper"), "{0}")[1].decode()
    assert "Where it comes from" not in page


def test_the_report_beside_the_model_file_goes_into_the_fmu(oven: Model, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("<p>what was found</p>", encoding="utf-8")
    file = tmp_path / "oven.toml"
    file.write_text(tomli_w.dumps(oven.to_table()), encoding="utf-8")
    plant, *_ = build.build_all(file, tmp_path / "out" / "oven.fmu", tmp_path / "out")
    with zipfile.ZipFile(plant) as archive:
        assert archive.read("documentation/report.html") == b"<p>what was found</p>"
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    assert (root.get("modelName"), root.get("generationDateAndTime")) == ("oven 3", generation_date())
