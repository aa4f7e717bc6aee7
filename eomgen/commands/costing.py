"""What each effect of a scene costs: `effects`."""

from eomgen.commands.shared import Arguments, located, read_model
from eomgen.files import check_folder
from eomgen.run.progress import terminal_notice


def effects(given: Arguments) -> int:
    """Print what each effect costs, and draw it."""
    from eomgen.show.bill import save_bill
    from eomgen.show.style import check_figure
    from eomgen.study.bill import bill

    model, name = read_model(given.scene, given)
    path = given.output / f"{name}_effects.png"
    check_folder(path.parent)
    check_figure(path, force=given.force)
    with located(given.scene), terminal_notice(f"costing {name} …"):
        found = bill(model)
    width = max([len("the mechanism itself"), *(len(item.name) for item in found.items)])
    kinds = max([0, *(len(item.type) for item in found.items)])
    print(f"{name}: one derivative takes {found.operations} operations, {_us(found.seconds)} µs")
    head = f"{'':<{width}}  {'':<{kinds}}"
    print(f"    {head}  operations   share        µs  states  inputs")
    print(
        f"    {'the mechanism itself':<{width}}  {'':<{kinds}}  {found.bare_operations:>10}"
        f"  {_share(found.bare_operations, found.operations)}  {_us(found.bare_seconds):>8}"
    )
    for item in found.items:
        print(
            f"    {item.name:<{width}}  {item.type:<{kinds}}  {item.operations:>10}"
            f"  {_share(item.operations, found.operations)}  {_us(item.seconds):>8}"
            f"  {item.states:>6}  {item.inputs:>6}"
        )
    for line in found.routes:
        print(f"    {line}")
    save_bill(found, path, force=given.force)
    print(f"    wrote {path}")
    return 0


def _us(seconds: float) -> str:
    return f"{1e6 * seconds:.1f}"


def _share(part: int, whole: int) -> str:
    return f"{part / whole if whole else 0.0:6.1%}"
