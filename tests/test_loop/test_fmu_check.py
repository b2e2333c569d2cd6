"""The checks of an FMU: each fault is found, named and explained, and what is right passes."""

import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest
from few import few_rows
from pythonfmu.builder import FmuBuilder

from bender_loop.fmu.check.archive import archive_findings
from bender_loop.fmu.check.check import check
from bender_loop.fmu.check.description import description_findings
from bender_loop.fmu.check.explanations import KNOWN, explained_failure
from bender_loop.fmu.check.findings import LEAVING, Finding
from bender_loop.fmu.check.standard import (
    fmpy_findings,
    fmutool_findings,
    fmutool_installed,
    schema_findings,
)
from bender_loop.fmu.check.trial_process import trial_findings

SLAVE = Path(__file__).parent / "slaves" / "bender_loop_test_faulty.py"
PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "fmu-in-other-tools.md"

GOOD = """<fmiModelDescription fmiVersion="2.0" modelName="lag" guid="{1}" generationDateAndTime="2026-01-01T00:00:00Z">
<CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"/>
<UnitDefinitions><Unit name="V"><BaseUnit kg="1" m="2" s="-3" A="-1"/></Unit></UnitDefinitions>
<DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0" unit="V"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real unit="V" nominal="2"/></ScalarVariable>
<ScalarVariable name="p" valueReference="2" causality="parameter" variability="fixed">
<Real start="1" min="0" max="2"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies="1"/></Outputs>
<InitialUnknowns><Unknown index="2"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>"""


def rules_say(*changes: tuple[str, str]) -> list[Finding]:
    text = GOOD
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return list(description_findings(ElementTree.fromstring(text)))


def test_a_good_description_passes():
    assert rules_say() == []


@pytest.mark.parametrize(
    ("change", "severity", "words"),
    [
        (('guid="{1}"', 'guid=""'), "error", "guid is empty"),
        (("00:00:00Z", "00:00:00+00:00"), "warning", "generationDateAndTime"),
        (('modelIdentifier="lag"', 'modelIdentifier="a lag"'), "error", "no C identifier"),
        (("<CoSimulation", '<CoSimulation needsExecutionTool="true"'), "warning", "needsExecutionTool"),
        (
            ('canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false" canSerializeFMUstate="1"'),
            "error",
            "canSerializeFMUstate is true",
        ),
        (('Size="true"', 'Size="false"'), "note", "canHandleVariableCommunicationStepSize is false"),
        (('<DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>', ""), "note", "DefaultExperiment"),
        (('stopTime="1"', 'stopTime="-1"'), "error", "ends at -1.0 s"),
        (('stepSize="0.01"', 'stepSize="0"'), "error", "default step is 0.0 s"),
        (('start="1"', 'start="3"'), "error", "p: start 3 lies outside 0 to 2"),
        (('start="1"', 'start="NaN"'), "error", "p: start is NaN"),
        (('max="2"', 'max="-1"'), "error", "p: min 0 lies above max -1"),
        (('nominal="2"', 'nominal="0"'), "error", "y: nominal is 0"),
        (('<Real start="0" unit="V"/>', '<Real start="0"/>'), "note", "no unit: u"),
        (('<BaseUnit kg="1" m="2" s="-3" A="-1"/>', ""), "note", "unit 'V': no BaseUnit"),
        (("<InitialUnknowns>", '<InitialUnknowns><Unknown index="2"/>'), "error", "lists index 2 2 times"),
        (('dependencies="1"', 'dependencies="3"'), "warning", "output y: depends on the parameter p"),
    ],
)
def test_each_rule_is_known(change: tuple[str, str], severity: str, words: str):
    found = [finding for finding in rules_say(change) if words in finding.what]
    assert [finding.severity for finding in found] == [severity]
    assert found[0].why
    assert found[0].remedy


def archived(path: Path, names: dict[str, bytes]) -> list[str]:
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in names.items():
            archive.writestr(name, data)
    with zipfile.ZipFile(path) as archive:
        return [finding.what for finding in archive_findings(archive, {"lag"})]


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ({}, "neither a folder binaries/<platform> nor sources"),
        ({"binaries/amiga/lag.so": b""}, "no binary for this platform"),
        ({"binaries/linux64/log.so": b"", "binaries/win64/log.dll": b""}, "no binary is called lag"),
        ({"sources/lag.c": b"", "../lag.c": b""}, "not a relative path"),
        ({"sources/lag.c": b""}, "documentation/index.html is missing"),
    ],
)
def test_archive_rules(tmp_path: Path, names: dict[str, bytes], words: str):
    assert any(words in what for what in archived(tmp_path / "lag.fmu", names))


def test_a_damaged_entry_is_named(tmp_path: Path):
    path = tmp_path / "lag.fmu"
    archived(path, {"sources/lag.c": b"int main(void) { return 0; }"})
    path.write_bytes(path.read_bytes().replace(b"int main", b"int moin"))
    with zipfile.ZipFile(path) as archive:
        found = [finding.what for finding in archive_findings(archive, set())]
    assert any(what.startswith("sources/lag.c: damaged") for what in found)


def test_the_schema_is_held_against_the_description():
    (finding,) = schema_findings("2.0", GOOD.replace('name="p" ', "").encode())
    assert "'name' is required" in finding.what
    assert list(schema_findings("2.0", b"<fmi")) != []
    assert list(schema_findings("4.0", b"<fmi")) == []


@pytest.mark.slow
def test_other_checkers_are_heard_and_explained(edited):
    path = edited(('<Unknown index="2"', '<Unknown index="3"'))
    found = [*fmpy_findings(path), *(fmutool_findings(path) if fmutool_installed() else ())]
    assert any(finding.what.startswith("fmpy: ") for finding in found)
    if fmutool_installed():
        assert any(finding.what.startswith("fmutool: ") for finding in found)
    assert all(finding.why and finding.remedy for finding in found)


def test_the_messages_of_the_page_are_known():
    text = PAGE.read_text(encoding="utf-8").partition("## Troubleshooting")[2].partition("Others:")[0]
    messages = [message for _, message in re.findall(r"(`{1,2})([^`].*?)\1(?!`)", text.partition("- ")[2])]
    assert len(messages) >= len(KNOWN)
    assert all(explained_failure(message, "new", "").why != "new" for message in messages)


@pytest.fixture(scope="module")
def sound_fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("faulty")
    return Path(
        FmuBuilder.build_FMU(
            SLAVE, dest=folder, canGetAndSetFMUstate=True, canSerializeFMUstate=True, needsExecutionTool=False
        )
    )


@pytest.mark.parametrize(
    ("fault", "severity", "words"),
    few_rows(
        [
            ("", None, ""),
            ("crash", "error", "a run from t = 0: the process that ran the FMU broke off with signal 6"),
            ("leaves", "error", "a run from t = 0: the process that ran the FMU broke off with exit status 0"),
            ("nan", "error", "y is not finite after a step"),
            ("no package", "error", "No module named"),
            ("left over", "error", "a run after a reset differs"),
            ("forgetful", "error", "a run from a saved state differs"),
            ("forgetful", "error", "a run from a serialised state differs"),
            ("starts at zero only", "error", "the start time must be 0"),
            ("lets nan through", "warning", "an input that is not a number is taken and comes out again"),
            ("coarse", "note", "when the communication step is halved"),
            (
                "aborts at the end",
                "warning",
                "leaving the process: the process that ran the FMU broke off",
            ),
        ],
        0,
        3,
        6,
        9,
        11,
    ),
)
def test_the_trial_run_finds_faults(sound_fmu: Path, tmp_path: Path, fault: str, severity: str | None, words: str):
    path = faulty(sound_fmu, tmp_path, fault)
    found = list(trial_findings(path))
    if fault != "aborts at the end":
        # what PythonFMU itself does now and then, after all results are there
        found = [finding for finding in found if not finding.what.startswith(LEAVING)]
    if severity is None:
        assert found == []
    else:
        assert [finding.severity for finding in found if words in finding.what] == [severity], found


def test_an_fmu_that_hangs_is_told(sound_fmu: Path, tmp_path: Path):
    (finding,) = trial_findings(faulty(sound_fmu, tmp_path, "hang"), seconds=1.0)
    # a machine that is busy needs the second for loading alone
    assert finding.what.endswith(": no end within 1 s")


def test_what_cannot_be_run_is_left_out_with_the_reason(edited):
    report = check(edited(("<CoSimulation", "<ModelExchange")))
    assert any("trial run: for co-simulation only" in reason for reason in report.left_out)
    report = check(edited(('fmiVersion="2.0"', 'fmiVersion="7.0"')))
    assert [finding.what for finding in report.faults] == ["fmiVersion is '7.0'"]
    assert (
        check(edited(("<ModelVariables>", "<ModelVariables"))).findings[0].what.startswith("modelDescription.xml: not")
    )


@pytest.mark.parametrize("version", ["1.0", "3.0"])
def test_other_versions_are_held_against_their_schema(tmp_path: Path, version: str):
    path = tmp_path / "other.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", f'<fmiModelDescription fmiVersion="{version}" modelName="x"/>')
        archive.writestr("sources/x.c", "")
    report = check(path)
    assert any("schema" in finding.what for finding in report.faults)
    assert any(f"this one is {version}" in reason for reason in report.left_out)


def faulty(sound: Path, folder: Path, fault: str) -> Path:
    path = folder / "faulty.fmu"
    with zipfile.ZipFile(sound) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
        target.writestr("resources/fault.txt", fault)
    return path
