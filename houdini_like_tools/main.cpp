// The program: one sub-command per tool.
#include "command_line.h"
#include "tool.h"

int main(int argc, char** argv) {
  using namespace lamina::tools;
  const std::vector<AddTool> tools{
      // clang-format off: one tool a line, in the order of the help
      add_surface,
      add_scatter,
      add_compare,
      add_check,
      add_render,
      // clang-format on
  };
  return run_program(argc, argv, tools);
}
