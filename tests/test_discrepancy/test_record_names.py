import pytest

from bender_discrepancy.records.record_names import distinct_names


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["a.csv"], ["a.csv"]),
        (["runs/a.csv", "other/b.csv"], ["a.csv", "b.csv"]),
        (["monday/record.csv", "tuesday/record.csv"], ["monday/record.csv", "tuesday/record.csv"]),
        (
            ["x/monday/record.csv", "y/monday/record.csv", "c.csv"],
            ["x/monday/record.csv", "y/monday/record.csv", "c.csv"],
        ),
        (["record.csv", "monday/record.csv"], ["record.csv", "monday/record.csv"]),
        (["record.csv", "record.csv"], ["record.csv", "record.csv"]),
        (["record 1", "record 2"], ["record 1", "record 2"]),
        ([], []),
    ],
)
def test_names_are_as_short_as_distinguishes_them(names, told):
    assert distinct_names(names) == told
