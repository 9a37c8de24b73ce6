"""Point clouds as surfaces in Blender, by the program lamina."""

bl_info = {
    "name": "Lamina: point clouds as surfaces",
    "author": "Lamina's authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "File > Import > Point cloud as surface (Lamina); 3D View > Sidebar > Lamina",
    "description": "Reconstructs coloured meshes and volumes from scans with the program lamina",
    "category": "Import-Export",
}


def register():
    from . import ui  # noqa: PLC0415: ply and program serve without Blender, too

    ui.register()


def unregister():
    from . import ui  # noqa: PLC0415

    ui.unregister()
