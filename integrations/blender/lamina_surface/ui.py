"""What the user sees: settings, the entry in File > Import, and the panel in the sidebar."""

import os
from pathlib import Path

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)
from bpy_extras.io_utils import ImportHelper

from . import objects, ply, program

PATTERNS = "*.ply;*.las;*.laz;*.e57;*.xyz;*.txt;*.csv;*.pts;*.ptx;*.pcd;*.obj;*.gz;*.vdb"
PRESETS = [
    ("NONE", "By itself", "The program chooses by what it finds in the files"),
    ("object", "Object", "A thing scanned from all sides"),
    ("terrestrial", "Terrestrial", "Rooms, facades and sites from scanners on tripods"),
    ("aerial", "Aerial", "Ground and roofs from planes and drones, by laser"),
    ("handheld", "Handheld", "Scanners carried along: many passes over the same places"),
    ("photogrammetry", "Photogrammetry", "Dense points of photographs"),
]
VOLUMES = [
    ("NONE", "None", "The mesh alone"),
    ("LEVEL_SET", "Level set", "The signed distance the mesh comes from, as for Volume to Mesh or Houdini"),
    ("FOG", "Fog", "A density, which Blender draws and renders"),
]


class LaminaInput(bpy.types.PropertyGroup):
    path: StringProperty(name="File", description="Points: a file, a folder or a pattern", subtype="FILE_PATH")


class LaminaSettings(bpy.types.PropertyGroup):
    inputs: CollectionProperty(type=LaminaInput)
    chosen: IntProperty()
    preset: EnumProperty(name="Preset", items=PRESETS, description="What kind of scan it is")
    automatic: BoolProperty(
        name="By the noise", default=True, description="Smoothness follows the noise that is found"
    )
    blend: FloatProperty(
        name="Smoothness", default=1.5, min=1, soft_max=4, max=64,
        description="Radius around each sample that it acts in, in sample radii: 1 keeps all detail and all noise, 3 is "
        "smooth and has fewer triangles",
    )  # fmt: skip
    keep: FloatProperty(
        name="Triangles", default=1, min=0.01, max=1, subtype="FACTOR",
        description="Simplify the mesh to this part of its triangles, most where it is flat",
    )  # fmt: skip
    colours: BoolProperty(name="Colours", default=True, description="Give the mesh the points' colours, and a material")
    volume: EnumProperty(name="Volume", items=VOLUMES, description="OpenVDB volume beside the mesh")
    volume_folder: StringProperty(
        name="Volume folder", subtype="DIR_PATH",
        description="Where the .vdb is kept; empty: beside the .blend file, or beside the points while it has none",
    )  # fmt: skip
    progress: FloatProperty(name="Progress", min=0, max=100, subtype="PERCENTAGE")
    doing: StringProperty()


class LaminaPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__
    program: StringProperty(
        name="Program", subtype="FILE_PATH", description="The program lamina; empty: the one on the PATH"
    )
    threads: IntProperty(name="Threads", min=0, max=4096, description="0: all cores")

    def draw(self, _context):
        self.layout.prop(self, "program")
        self.layout.prop(self, "threads")


def _volume_file(settings, inputs):
    """A new file's name: one that is in use by another object is left alone."""
    folder = bpy.path.abspath(settings.volume_folder or "//") or os.path.dirname(os.path.abspath(inputs[0]))
    stem = Path(inputs[0]).name.split(".")[0] or "points"
    name, number = Path(folder) / f"{stem}.vdb", 1
    while name.exists():
        name, number = Path(folder) / f"{stem}_{number}.vdb", number + 1
    return str(name)


class Reconstruction:
    """One run: from the settings to objects in the scene."""

    def __init__(self, context, inputs):
        settings = context.scene.lamina
        preferences = context.preferences.addons[__package__].preferences
        if not inputs:
            raise program.ProgramError("name the points first")
        self.name = Path(inputs[0]).name.split(".")[0] or "points"
        self.colours = settings.colours
        self.volume_file = "" if settings.volume == "NONE" else _volume_file(settings, inputs)
        options = {
            "preset": "" if settings.preset == "NONE" else settings.preset,
            "blend": None if settings.automatic else round(settings.blend, 4),
            "threads": preferences.threads,
            "keep": round(settings.keep, 4),
            "volume_file": self.volume_file,
            "fog": settings.volume == "FOG",
        }
        self.run = program.Run(
            program.find_program(bpy.path.abspath(preferences.program)),
            lambda folder: program.surface_steps(inputs, folder, options),
        )

    def finish(self, context):
        """The objects, once `run.poll()` is true."""
        mesh = ply.read_mesh(program.result_files(self.run.folder)["mesh"])
        size = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
        made = [objects.add_mesh(self.name, mesh, self.colours)]
        if self.volume_file:
            made.append(objects.add_volume(self.name + " volume", self.volume_file))
        objects.place(context, made, program.shift_of(self.run.folder), size)
        self.run.close()
        for other in context.selected_objects:
            other.select_set(False)
        made[0].select_set(True)
        context.view_layer.objects.active = made[0]
        triangles = len(made[0].data.polygons)
        return f"{self.name}: {triangles} triangles"

    def cancel(self):
        """Also where the program has ended by itself meanwhile."""
        self.run.cancel()
        self.discard()

    def discard(self):
        """Nothing of it stays; the volume's name was free when it began."""
        self.run.close()
        if self.volume_file:
            Path(self.volume_file).unlink(missing_ok=True)


class Running:
    """The run that goes on: there is one at a time, and the panel's button must reach it."""

    cancel_asked = False
    reconstruction = None


class _Reconstructs:
    """Mixed into operators: runs in the background, or to its end where Blender has no window."""

    def begin(self, context, inputs):
        if Running.reconstruction:
            self.report({"ERROR"}, "a reconstruction is running")
            return {"CANCELLED"}
        try:
            reconstruction = Reconstruction(context, [bpy.path.abspath(path) for path in inputs])
        except program.ProgramError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if bpy.app.background:
            return self._wait(context, reconstruction)
        Running.reconstruction, Running.cancel_asked = reconstruction, False
        self._timer = context.window_manager.event_timer_add(0.2, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _wait(self, context, reconstruction):
        reconstruction.run.wait()
        return self._poll(context, reconstruction)

    def _poll(self, context, reconstruction):
        """What to return to Blender, or None while the program runs."""
        try:
            if not reconstruction.run.poll():
                return None
            self.report({"INFO"}, reconstruction.finish(context))
            return {"FINISHED"}
        except (program.ProgramError, ply.PlyError, OSError) as error:
            reconstruction.discard()
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}

    def modal(self, context, event):
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        reconstruction, settings = Running.reconstruction, context.scene.lamina
        if Running.cancel_asked:
            reconstruction.cancel()
            self.report({"INFO"}, "reconstruction cancelled")
            return self._end(context, {"CANCELLED"})
        outcome = self._poll(context, reconstruction)
        if outcome:
            return self._end(context, outcome)
        settings.progress = 100 * reconstruction.run.fraction
        settings.doing = reconstruction.run.text
        context.workspace.status_text_set(f"Lamina: {settings.progress:.0f} %, {settings.doing}; cancel in the sidebar")
        for area in context.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
        return {"PASS_THROUGH"}

    def _end(self, context, outcome):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        context.scene.lamina.progress = 0
        Running.reconstruction = None
        return outcome


class LAMINA_OT_import(_Reconstructs, bpy.types.Operator, ImportHelper):
    """Reconstruct the surface that points were taken from"""

    bl_idname = "import_mesh.lamina"
    bl_label = "Import points as surface"
    bl_options = {"REGISTER"}
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: StringProperty(default=PATTERNS, options={"HIDDEN"})

    def draw(self, context):
        draw_settings(self.layout, context.scene.lamina)

    def execute(self, context):
        paths = [os.path.join(self.directory, file.name) for file in self.files if file.name]
        return self.begin(context, paths or [self.filepath])


class LAMINA_OT_reconstruct(_Reconstructs, bpy.types.Operator):
    """Reconstruct the surface of the points in the list; several files are one cloud"""

    bl_idname = "lamina.reconstruct"
    bl_label = "Reconstruct"

    def execute(self, context):
        return self.begin(context, [one.path for one in context.scene.lamina.inputs])


class LAMINA_OT_cancel(bpy.types.Operator):
    """Stop the reconstruction; nothing of it stays"""

    bl_idname = "lamina.cancel"
    bl_label = "Cancel"

    def execute(self, _context):
        Running.cancel_asked = True
        return {"FINISHED"}


class LAMINA_OT_add_inputs(bpy.types.Operator, ImportHelper):
    """Add files of points to the list"""

    bl_idname = "lamina.add_inputs"
    bl_label = "Add points"
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: StringProperty(default=PATTERNS, options={"HIDDEN"})

    def execute(self, context):
        for file in self.files:
            context.scene.lamina.inputs.add().path = os.path.join(self.directory, file.name)
        return {"FINISHED"}


class LAMINA_OT_remove_input(bpy.types.Operator):
    """Take the chosen file off the list"""

    bl_idname = "lamina.remove_input"
    bl_label = "Remove points"

    def execute(self, context):
        settings = context.scene.lamina
        settings.inputs.remove(settings.chosen)
        settings.chosen = max(0, min(settings.chosen, len(settings.inputs) - 1))
        return {"FINISHED"}


class LAMINA_UL_inputs(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property):
        layout.prop(item, "path", text="", emboss=False, icon="POINTCLOUD_DATA")


class LAMINA_PT_panel(bpy.types.Panel):
    bl_label = "Points to surface"
    bl_category = "Lamina"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"

    def draw(self, context):
        layout, settings = self.layout, context.scene.lamina
        row = layout.row()
        row.template_list("LAMINA_UL_inputs", "", settings, "inputs", settings, "chosen", rows=3)
        buttons = row.column(align=True)
        buttons.operator("lamina.add_inputs", text="", icon="ADD")
        buttons.operator("lamina.remove_input", text="", icon="REMOVE")
        draw_settings(layout, settings)
        if Running.reconstruction:
            layout.prop(settings, "progress", text=settings.doing, slider=True)
            layout.operator("lamina.cancel", icon="CANCEL")
        else:
            layout.operator("lamina.reconstruct", icon="MESH_DATA")


def draw_settings(layout, settings):
    column = layout.column()
    column.use_property_split = True
    column.use_property_decorate = False
    column.prop(settings, "preset")
    column.column(heading="Smoothness").prop(settings, "automatic")
    if not settings.automatic:
        column.prop(settings, "blend")
    column.prop(settings, "keep")
    column.prop(settings, "colours")
    column.prop(settings, "volume")
    if settings.volume != "NONE":
        column.prop(settings, "volume_folder")


def _menu_entry(menu, _context):
    menu.layout.operator(LAMINA_OT_import.bl_idname, text="Point cloud as surface (Lamina)")


CLASSES = (
    LaminaInput,
    LaminaSettings,
    LaminaPreferences,
    LAMINA_OT_import,
    LAMINA_OT_reconstruct,
    LAMINA_OT_cancel,
    LAMINA_OT_add_inputs,
    LAMINA_OT_remove_input,
    LAMINA_UL_inputs,
    LAMINA_PT_panel,
)


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.lamina = PointerProperty(type=LaminaSettings)
    bpy.types.TOPBAR_MT_file_import.append(_menu_entry)


def unregister():
    if Running.reconstruction:
        Running.reconstruction.cancel()
        Running.reconstruction = None
    bpy.types.TOPBAR_MT_file_import.remove(_menu_entry)
    del bpy.types.Scene.lamina
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
