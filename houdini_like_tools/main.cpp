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
      add_merge,
      // clang-format on
  };
  return run_program(argc, argv, tools);
}
