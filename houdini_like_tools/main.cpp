// The program: one sub-command per tool.
#include "command_line.h"
#include "tool.h"

int main(int argc, char** argv) {
  using namespace lamina::tools;
  const std::vector<AddTool> tools{
      // One tool a line, in the order of the help.
      // clang-format off
      add_surface,
      add_scatter,
      add_compare,
      add_check,
      add_render,
      add_volume,
      add_info,
      add_measure,
      add_convert,
      add_merge,
      add_clean,
      add_clip,
      add_transform,
      add_sort,
      add_normal,
      add_radius,
      add_attribtransfer,
      add_completion,
      add_man,
      // clang-format on
  };
  return run_program(argc, argv, tools);
}
