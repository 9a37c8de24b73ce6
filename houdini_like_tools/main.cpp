// The program: one sub-command per tool.
#include <malloc.h>

#include "common/command_line.h"
#include "tool.h"

namespace {

/// Large arrays go back to the system when they are freed. By default the C library raises the size from which they do
/// with the first one freed, and keeps gaps between what lives long: a fifth of the memory at 16 million samples.
void return_large_arrays() {
#ifdef __GLIBC__
  constexpr int kLarge = 128 << 10;
  mallopt(M_MMAP_THRESHOLD, kLarge);
#endif
}

/// Small ones are asked for again from slab to slab: what lies free at the end of the heap stays, and the heap grows in
/// large steps. Given back and taken again page by page it would be a twentieth of a run's processor time.
void keep_small_arrays() {
#ifdef __GLIBC__
  constexpr int kKept = 64 << 20;
  constexpr int kStep = 16 << 20;
  mallopt(M_TRIM_THRESHOLD, kKept);
  mallopt(M_TOP_PAD, kStep);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  return_large_arrays();
  keep_small_arrays();
  using namespace lamina::tools;
  const std::vector<AddTool> tools{
      // One tool a line, in the order of the help.
      // clang-format off
      add_surface,
      add_scatter,
      add_compare,
      add_check,
      add_render,
      add_view,
      add_volume,
      add_info,
      add_measure,
      add_convert,
      add_merge,
      add_clean,
      add_clip,
      add_simplify,
      add_tiles,
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
