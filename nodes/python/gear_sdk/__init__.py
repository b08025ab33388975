"""Nodes for gear in Python: a node is a decorated function.

    from gear_sdk import Annotated, Context, Image, Plugin, number

    plugin = Plugin("blur")

    @plugin.node(outputs={"image": (Image, "The blurred picture.")})
    def Blur(ctx: Context, image: Annotated[Image, "The picture."], *, radius: float = number(2.0, "How far.", unit="px", above=0)):
        \"\"\"Blurs a picture.\"\"\"
        ...

    if __name__ == "__main__":
        plugin.serve()

Needs Python 3.9 or later and numpy. Import what is heavy inside the functions that use it, so that gear can ask for the
description of the nodes on a machine that has none of it.
"""

from typing import Annotated

from .context import Cancelled, Context, NodeFailure
from .params import Param, choice, flag, integer, number, numbers, optional, or_auto, text, variant
from .plugin import Node, Plugin
from .values import (
    Camera,
    Field,
    Image,
    Mask,
    Number,
    Orthographic,
    Pinhole,
    Report,
    Scene,
    View,
    Views,
)

__all__ = [
    "Annotated",
    "Camera",
    "Cancelled",
    "Context",
    "Field",
    "Image",
    "Mask",
    "Node",
    "NodeFailure",
    "Number",
    "Orthographic",
    "Param",
    "Pinhole",
    "Plugin",
    "Report",
    "Scene",
    "View",
    "Views",
    "choice",
    "flag",
    "integer",
    "number",
    "numbers",
    "optional",
    "or_auto",
    "text",
    "variant",
]

__version__ = "0.1.0"
