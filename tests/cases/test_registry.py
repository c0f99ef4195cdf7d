"""Cases and their parameters from text; whatever is unknown is answered with the nearest known name."""

import pytest

from dembench.cases.base import CaseError
from dembench.cases.registry import case, names, parse_case, problem_title


def test_parameters_from_text():
    found, parameters = parse_case("case3[bed=50k, jitter=1e-5]")
    assert found is case("case3") and parameters.bed == "50k" and parameters.jitter == 1e-5
    assert parse_case(" case3 ")[1].bed == "25k"
    assert parse_case("case3[]")[1] == parse_case("case3")[1]


@pytest.mark.parametrize(
    "text,expected",
    [
        ("case4", "Did you mean 'case3'"),
        ("impact", "Known are case1, case2, case3"),
        ("case3[bd=25k]", "'bd'. Did you mean 'bed'? Accepted are "),
        ("case3[orifice=small]", "no parameter 'orifice'"),
        ("case3[bed=26k]", "'25k', '50k' or '100k' (given: '26k')"),
        ("case3[jitter=-1]", "greater than or equal to 0 (given: '-1')"),
        ("case3[jitter=much]", "given: 'much'"),
        ("case3[bed]", "write name=value"),
        ("case3[bed=]", "write name=value"),
        ("case3[bed=25k,bed=50k]", "more than once"),
        ("case3[bed=25k", "is no case"),
        ("case3[bed=25k]x", "is no case"),
        ("../case3", "is no case"),
        ("case3;shell", "is no case"),
        ("", "is no case"),
    ],
)
def test_what_is_not_known(text, expected):
    with pytest.raises(CaseError) as caught:
        parse_case(text)
    assert expected in str(caught.value)


def test_problems_on_softer_materials_are_called_so():
    assert problem_title("case1[orifice=small]", "quick") == "case1[orifice=small], quick, softened"
    assert problem_title("case1", "published") == "case1, published"
    assert problem_title("case3", "quick") == "case3, quick"
    assert problem_title("scene.json", None) == "scene.json"
    assert problem_title("case9", "quick") == "case9, quick"


def test_every_case_says_what_it_is():
    for name in names():
        found = case(name)
        assert found.name == name and found.title and "doi" in found.source
        found.parameters()
