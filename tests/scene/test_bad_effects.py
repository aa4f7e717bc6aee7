"""Every field of every effect, given what it cannot be: one line with place, value and remedy.

What single effects refuse beside that is with their own tests.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from scenes import refusal

from eomgen.commands.main import main
from eomgen.language.formula import Formula
from eomgen.model.elaborate import elaborate
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import EffectTable
from eomgen.scene.reader import parse_scene

CRANE = """\
name = "crane"
dimensions = {dimensions}
inputs = ["wish"]
[parameters]
stiff = -4.0
[[bodies]]
name = "boom"
mass = 1
inertia_com = {inertia}
[[bodies]]
name = "trolley"
mass = 1
inertia_com = {inertia}
[[joints]]
name = "hinge"
type = "revolute"
parent = "world"
child = "boom"
r_child = {arm}
coordinate = "swing"
{axis}
[[joints]]
name = "rail"
type = "prismatic"
parent = "boom"
child = "trolley"
axis = {arm}
coordinate = "run"
"""
TABLES: dict[str, dict[str, str]] = {
    "gravity": {"g": "9.8"},
    "point_gravity": {"mu": "1", "at": "{v}"},
    "drag": {"body": '"boom"', "linear": "1", "quadratic": "1", "turning_linear": "1",
             "turning_quadratic": "1", "wind": "{v}", "at": "{v}"},
    "drag made": {"body": '"boom"', "density": "1", "area": "1", "coefficient": "1"},
    "field": {"body": '"boom"', "force": "{v}", "at": "{v}"},
    "field attract": {"body": '"boom"', "kind": '"attract"', "strength": "1", "softening": "1",
                      "center": "{v}"},
    "field avoid": {"body": '"boom"', "kind": '"avoid"', "steering": "1", "radius": "1",
                    "reach": "1", "center": "{v}"},
    "external_force": {"body": '"boom"', "force": "{v}", "at": "{v}"},
    "external_torque": {"body": '"boom"', "torque": "{t}"},
    "spring": {"body_1": '"boom"', "body_2": '"trolley"', "stiffness": "1", "damping": "1",
               "rest_length": "1", "at_1": "{v}", "at_2": "{v}"},
    "spring law": {"body_1": '"boom"', "body_2": '"world"', "law": "1"},
    "pairwise": {"bodies": '"all"', "gravitation": "1", "softening": "1"},
    "pairwise springs": {"bodies": '"all"', "stiffness": "1", "damping": "1", "rest_length": "1"},
    "pairwise law": {"bodies": '"all"', "law": "1"},
    "joint_spring": {"joint": '"hinge"', "stiffness": "1", "damping": "1", "rest": "1"},
    "joint_spring law": {"joint": '"hinge"', "law": "1"},
    "joint_friction": {"joint": '"rail"', "viscous": "1", "coulomb": "1", "speed": "1"},
    "joint_stop": {"joint": '"rail"', "low": "-1", "high": "1", "stiffness": "1", "damping": "1"},
    "joint_stop rigid": {"joint": '"hinge"', "low": "-1", "restitution": "1"},
    "contact": {"body": '"boom"', "law": '"spring_damper"', "radius": "1", "corners": "{c}",
                "at": "{v}", "offset": "1", "other": '"trolley"', "stiffness": "1",
                "damping": "1", "friction": "1", "slip_speed": "1"},
    "contact ball": {"bodies": '"all"', "law": '"hunt_crossley"', "against": '"ball"',
                     "radii": "{{ boom = 1 }}", "radius": "1", "other_radius": "1",
                     "other_at": "{v}", "stiffness": "1", "dissipation": "1"},
    "contact hills": {"body": '"boom"', "law": '"spring_damper"', "against": '"heights"',
                      "height": "1", "radius": "1", "stiffness": "1"},
    "contact rigid": {"body": '"boom"', "law": '"impact"', "restitution": "1"},
    "driven": {"joint": '"rail"', "coordinate": '"sin(t)"'},
    "motor": {"joint": '"rail"', "torque": "1"},
    "pd": {"joint": '"rail"', "target": "1", "target_rate": "1", "stiffness": "1", "damping": "1",
           "limit": "1", "lag": "1"},
    "pid": {"joint": '"rail"', "target": "1", "target_rate": "1", "stiffness": "1", "damping": "1",
            "limit": "1", "lag": "1", "integral_gain": "1", "tracking": "1"},
    "controller": {"torques": '{{ hinge = "z" }}', "states": '{{ z = {{ rate = "swing" }} }}'},
    "sampled_controller": {"period": "0.1", "inputs": '{{ wish = "z" }}', "seed": "1",
                           "torques": '{{ hinge = "z" }}', "states": '{{ z = {{ next = "s" }} }}',
                           "sensors": '{{ s = {{ value = "swing", noise = 1, quantum = 1 }} }}'},
    "tether": {"length": "9", "restitution": "1",
               "through": '[{{ body = "world", at = {v} }}, {{ body = "trolley" }}]'},
}  # fmt: skip
"""Of every effect good tables, which together give every field that holds a quantity or a name."""
OF_ANY_SIGN = set(
    "contact.at contact.height contact.offset contact.other_at contact.restitution "
    "controller.torques drag.at drag.wind driven.coordinate external_force.at "
    "external_force.force external_torque.torque field.at field.center field.force gravity.g "
    "joint_spring.law joint_spring.rest joint_stop.high joint_stop.low joint_stop.restitution "
    "motor.torque pairwise.law pd.target pd.target_rate pid.target pid.target_rate "
    "point_gravity.at sampled_controller.inputs sampled_controller.torques spring.at_1 "
    "spring.at_2 spring.law spring.rest_length tether.restitution".split()
)
"""Forces, places, laws and targets; a restitution has two bounds, and tests of its own. All else,
stiffness, damping, drag, gains, is not negative.
"""
MEMBERS: dict[str, type[EffectTable]] = {
    member.model_fields["type"].annotation.__args__[0]: member
    for member in get_args(get_args(Effect)[0])
}
TESTED = sorted(MEMBERS.keys() & {name.split()[0] for name in TABLES})


def crane(kind: str, dimensions: int = 2, **changed: str | None) -> str:
    """The scene with one effect; a field that is changed to None is left out."""
    space = dimensions == 3
    arm = "[0.5, 0, 0]" if space else "[0.5, 0]"
    vectors = {"v": arm, "c": arm.replace(" 0", " 1"), "t": arm if space else 1}
    fields = {key: value.format(**vectors) for key, value in TABLES[kind].items()}
    fields |= {"type": f'"{kind.split()[0]}"', "name": '"effect"'}
    given = {key: changed.get(key, value) for key, value in {**fields, **changed}.items()}
    return (
        CRANE.format(
            dimensions=dimensions,
            inertia="[1, 1, 1]" if space else "1",
            axis="axis = [0, 0, 1]" if space else "",
            arm=arm,
        )
        + "[[effects]]\n"
        + "".join(f"{k} = {v}\n" for k, v in given.items() if v is not None)
    )


def quantities(kind: str) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Each field of a table that holds a quantity: key, what it holds; unit, there, and bound."""
    member = MEMBERS[kind.split()[0]]
    effect = elaborate(parse_scene(crane(kind))).effects[0]
    for field, info in member.model_fields.items():
        extra = info.json_schema_extra
        key = info.alias or field
        if key in TABLES[kind] and isinstance(extra, dict) and "unit" in extra:
            turning, *sliding = extra["unit"].split(" | ")
            unit = sliding[-1] if sliding and "rail" in TABLES[kind].get("joint", "") else turning
            yield key, getattr(effect, field), {**extra, "unit": unit}


def test_all_effects_are_here() -> None:
    """A new effect needs a table above, which gives every quantity and name that it has."""
    assert set(TESTED) == set(MEMBERS)
    free = set()
    for kind, member in MEMBERS.items():
        given = {key for name, table in TABLES.items() if name.split()[0] == kind for key in table}
        for field, info in member.model_fields.items():
            extra = info.json_schema_extra
            if isinstance(extra, dict) and "unit" in extra:
                key = info.alias or field
                assert key in given, f"{kind}.{key}"
                free |= {f"{kind}.{key}"} if extra["bound"] == "any" else set()
    assert free == OF_ANY_SIGN
    for kind in TABLES:
        for dimensions in (2, 3):
            elaborate(parse_scene(crane(kind, dimensions)))


@pytest.mark.parametrize("kind", TABLES)
def test_quantities(kind: str) -> None:
    """Values of the wrong kind or sign, formulas with names that nothing has."""
    active = "allow_active" in MEMBERS[kind.split()[0]].model_fields
    for field, value, extra in quantities(kind):
        place = f"effects[0].{field}"
        form = "{}"
        if isinstance(value, tuple):
            place, form = f"{place}[1]", "[0.5, {}]"
        elif isinstance(value, dict):
            (key,) = value
            place, form = f"{place}.{key}", f"{{{{ {key} = {{}} }}}}"

        def put(given: str, field: str = field, form: str = form, **more: str) -> str:
            return crane(kind, **{field: form.format(given)}, **more)

        said = refusal(put("nan"))
        assert said == f"{place}: nan is not a finite number; give one that is"
        for wrong, shown in (("true", "True"), ("1979-05-27", "datetime.date(1979, 5, 27)")):
            said = refusal(put(wrong))
            assert said == f"{place}: {shown} is neither a number nor a formula; give one"
        assert refusal(put('"stif"')).startswith(
            f"{place}: unknown parameter 'stif' (did you mean 'sti"
        )
        assert refusal(put('"2*unheard"')) == (
            f"{place}: unknown parameter 'unheard'; give it a value in [parameters]"
        )
        assert refusal(put('"stiff.real"')) == (
            f"{place}: 'stiff.real' has '.real' at column 6, which is not allowed"
        )
        assert refusal(put('"1/(stiff + 4)"')) == f"{place}: " + (
            "it, its rate or its acceleration is not finite at t = 0; change the formula"
            if kind == "driven"
            else "its value is not a finite number; change its parameters"
        )
        assert refusal(put("1e101")) == f"{place}: 1e+101 is larger than 1e+100; choose other units"
        if "motion" not in extra.get("sees", ()):
            assert refusal(put('"2*swing"')) == f"{place}: 'swing' " + (
                "is part of the solution, which a prescribed motion cannot depend on; "
                "use t and parameters"
                if kind == "driven"
                else "changes with the motion, which this value must not; use parameters"
            )
        bound = {
            "positive": "is not positive; give a number >",
            "nonnegative": "is negative; give a number >=",
        }.get(str(extra["bound"]))
        if bound is None:
            elaborate(parse_scene(put("0.25")))
            continue
        assert refusal(put("-4")) == f"{place}: -4 {bound} 0 in {extra['unit']}"
        assert refusal(put('"stiff"')) == f"{place}: -4 {bound} 0 in {extra['unit']}"
        if extra["bound"] == "positive":
            assert refusal(put("0")) == f"{place}: 0 {bound} 0 in {extra['unit']}"
        elif active and extra["unit"] == "m":  # a length is never negative
            assert refusal(put("-4", allow_active="true")) == refusal(put("-4"))
        elif active:
            elaborate(parse_scene(put("-4", allow_active="true")))
            assert refusal(put("-4", allow_active="false")) == refusal(put("-4"))


@pytest.mark.parametrize("kind", TABLES)
def test_names_and_vectors(kind: str) -> None:
    """Bodies and joints that are not there or not named; vectors too long, in plane and space."""
    member = MEMBERS[kind.split()[0]]
    for field in (*member.body_fields, *member.anchor_fields):
        if field not in TABLES[kind] or TABLES[kind][field] == '"all"':
            continue
        if TABLES[kind][field].startswith("["):  # tables, whose mistakes are with their own tests
            continue
        place = f"effects[0].{field}"
        if TABLES[kind][field].startswith("{"):
            assert refusal(crane(kind, **{field: "{ boon = 1 }"})) == (
                f"{place}.boon: no body is named 'boon' (did you mean 'boom'?)"
            )
            continue
        assert refusal(crane(kind, **{field: '"boon"'})) == (
            f"{place}: no body is named 'boon' (did you mean 'boom'?)"
        )
        assert refusal(crane(kind, **{field: '"hinge"'})).startswith(
            f"{place}: no body is named 'hinge'; known: "
        )
        assert refusal(crane(kind, **{field: "3"})) == f"{place}: 3 is not a text; give one"
        assert refusal(crane(kind, **{field: '"my boom"'})) == (
            f"{place}: 'my boom' is not an identifier; use letters a-z, digits, _ and -, "
            "starting with a letter"
        )
        if member.model_fields[field].default == "world":
            elaborate(parse_scene(crane(kind, **{field: None})))
        else:
            missing = refusal(crane(kind, **{field: None}))
            assert missing in (
                f"{place}: missing; every such table needs it",
                f"{place}: is missing; give one of {', '.join(getattr(member, 'naming', ()))}",
            )
        if field in member.body_fields:
            assert refusal(crane(kind, **{field: '"world"'})) == (
                f"{place}: no body is named 'world'; known: boom, trolley"
            )
    for field in member.vector_fields:
        if field not in TABLES[kind]:
            continue
        place = f"effects[0].{field}"
        assert refusal(crane(kind, **{field: "[1, 2, 3]"})) == (
            f"{place}: has 3 components; the plane takes 2"
        )
        assert refusal(crane(kind, 3, **{field: "[1, 2]"})) == (
            f"{place}: has 2 components; space takes 3"
        )
        assert refusal(crane(kind, **{field: "[1]"})) == f"{place}: has 1 entry; give at least 2"
        assert refusal(crane(kind, **{field: "[[1, 2]]"})) == (
            f"{place}: has lists in it; give everything in one list"
        )
        assert refusal(crane(kind, **{field: "1"})) == f"{place}: 1 is not a list; give one"


@pytest.mark.parametrize("kind", [kind for kind in TABLES if "joint" in TABLES[kind]])
def test_joints(kind: str) -> None:
    """Joints that are not there, not named, or named twice; coordinates that they have not."""
    member = MEMBERS[kind.split()[0]]
    what = "revolute or prismatic joint" if member.joint_fields else "joint that moves"
    places = {"joint": '"{}"', "joints": '["{}"]'}
    for field in (*member.joint_fields, *member.dof_fields):
        place = f"effects[0].{field}" + "[0]" * (field == "joints")
        for name, hint in (("hing", " (did you mean 'hinge'?)"), ("boom", "; known: hinge, rail")):
            wrong = {"joint": None, field: places[field].format(name)}
            assert refusal(crane(kind, **wrong)) == f"{place}: no {what} is named '{name}'{hint}"
    several = "joints" in member.dof_fields
    assert refusal(crane(kind, joint=None)) == "effects[0].joint: " + (
        "is missing; give one of joint, joints" if several else "missing; every such table needs it"
    )
    if several:
        assert refusal(crane(kind, joints='["rail"]')) == (
            "effects[0].joint: is given in addition to 'joints'; give one of joint, joints"
        )
        assert refusal(crane(kind, joint=None, joints='["rail", "rail"]')) == (
            "effects[0].joints[1]: 'rail' is listed twice; leave one out"
        )
    if member.dof_fields:
        joint = TABLES[kind]["joint"].strip('"')
        own, other = ("swing", "run") if joint == "hinge" else ("run", "swing")
        elaborate(parse_scene(crane(kind, coordinate=f'"{own}"')))
        for name, hint in ((f"{own}s", f" (did you mean '{own}'?)"), (other, f"; known: {own}")):
            assert refusal(crane(kind, coordinate=f'"{name}"')) == (
                f"effects[0].coordinate: '{joint}' has no angle or slide '{name}'{hint}"
            )


@pytest.mark.parametrize("kind", TABLES)
def test_keys(kind: str) -> None:
    """Keys that are not known, a name that is missing or none, switches that are no truth."""
    member = MEMBERS[kind.split()[0]]
    key = next((key for key in TABLES[kind] if len(key) > 1), "name")
    assert refusal(crane(kind, **{f"{key}x": "1"})).startswith(
        f"effects[0].{key}x: unknown key (did you mean '{key}'?)"
    )
    assert refusal(crane(kind, zzzz="1")).startswith("effects[0].zzzz: unknown key; known here: ")
    assert refusal(crane(kind, type=f'"{member.model_fields["type"].annotation.__args__[0]}x"'))
    if member.model_fields["name"].is_required():
        assert refusal(crane(kind, name=None)) == (
            "effects[0].name: missing; every such table needs it"
        )
    assert refusal(crane(kind, name='"lambda"')) == (
        "effects[0].name: 'lambda' is a Python keyword; choose another name"
    )
    for field, info in member.model_fields.items():
        if info.annotation is bool:
            for wrong, shown in (("1", "1"), ('"true"', "'true'")):
                assert refusal(crane(kind, **{field: wrong})) == (
                    f"effects[0].{field}: {shown} is neither true nor false; give one"
                )


CLASHES = [
    ('[[effects]]\ntype = "motor"\nname = "swing"\njoint = "rail"\ntorque = "input"\n',
     "effects[1]: 'swing' would be the name of an input and of a coordinate (joints[0]); rename "
     "one of them"),
    ('[[effects]]\ntype = "motor"\nname = "stiff"\njoint = "rail"\ntorque = "input"\n',
     "effects[1]: 'stiff' would be the name of an input and of a parameter (parameters.stiff); "
     "rename one of them"),
    ('[[effects]]\ntype = "external_force"\nname = "effect"\nbody = "boom"\nforce = "input"\n',
     "effects[1].name: 'effect' is also the name of effects[0]; give each its own"),
    ('[[effects]]\ntype = "motor"\nname = "effect_stiffness"\njoint = "rail"\ntorque = "input"\n',
     "effects[1]: 'effect_stiffness' would be the name of an input and of a parameter "
     "(effects[0].stiffness); rename one of them"),
    ('[[effects]]\ntype = "gravity"\ng = 1\n[[effects]]\ntype = "gravity"\nname = "g2"\ng = 1\n',
     "effects[2].type: a second 'gravity'; give only one"),
    ('[[effects]]\ntype = "pid"\nname = "hold"\njoint = "rail"\ntarget = 0\nstiffness = 1\n'
     'integral_gain = 1\n[[effects]]\ntype = "motor"\nname = "hold_integral"\njoint = "rail"\n'
     'torque = "input"\n',
     "effects[1]: 'hold_integral' would be the name of a state and of an input (effects[2]); "
     "rename one of them"),
    ('[[effects]]\nname = "blank"\n', "effects[1].type: missing; it says what kind this is"),
    ('[[effects]]\nname = "blank"\ntype = "sprin"\n',
     "effects[1].type: unknown value 'sprin' (did you mean 'spring'?)"),
]  # fmt: skip


@pytest.mark.parametrize(("more", "message"), CLASHES)
def test_names_that_clash(more: str, message: str) -> None:
    """One name for two things, and effects of no kind."""
    assert refusal(crane("joint_spring") + more) == message


def test_through_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same line from every command, exit code 1, nothing written."""
    path = tmp_path / "crane.toml"
    path.write_text(crane("spring", stiffness='"stif*2"'))
    line = "effects[0].stiffness: unknown parameter 'stif' (did you mean 'stiff'?)"
    output = tmp_path / "out"
    for command in (
        ["check"],
        ["effects"],
        ["derive"],
        ["generate", "-o", str(output)],
        ["simulate", "-o", str(output)],
    ):
        assert main([command[0], str(path), *command[1:]]) == 1
        out, err = capsys.readouterr()
        assert out == "" and re.fullmatch(r"eomgen: crane\.toml:\d+: (.*)\n", err)[1] == line
    assert not output.exists() or not list(output.iterdir())


def test_formulas_stay_formulas() -> None:
    """A quantity read is a tree of constants, names and operations, never a text."""
    for kind in TABLES:
        for _, value, _ in quantities(kind):
            parts = value.values() if isinstance(value, dict) else value
            for part in parts if isinstance(value, dict | tuple) else (value,):
                assert isinstance(part, Formula)
