// The program: one sub-command per tool.
#include <link.h>
#include <malloc.h>
#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>

#include "common/command_line.h"
#include "tool.h"

namespace {

/// Large arrays go back to the system when they are freed. By default the C library raises the size from which they do
/// with the first one freed, and keeps gaps between what lives long: a fifth of the memory at 16 million samples. From
/// an eighth of this size on it would be 2 % less memory, and up to a tenth more time for pages cleared anew.
void return_large_arrays() {
#ifdef __GLIBC__
  constexpr int kLarge = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, kLarge);
#endif
}

/// Small ones are asked for again from slab to slab, all over the heap: address space for it is taken at once, in large
/// pages where the system has them, and what lies free at its end stays. Looking up pages, and giving them back and
/// taking them again, would be a tenth of a run's processor time. Comes before return_large_arrays().
void keep_small_arrays() {
#ifdef __GLIBC__
  constexpr int kHeap = 192 << 20;               // most runs' need
  constexpr int kStep = 16 << 20;                // beyond it
  mallopt(M_TRIM_THRESHOLD, kHeap + 2 * kStep);  // freed below, it must not go back with its padding
  mallopt(M_TOP_PAD, kStep);
  mallopt(M_MMAP_THRESHOLD, 2 * kHeap);
  void* const heap = std::malloc(kHeap);
  if (heap == nullptr) return;
  constexpr std::uintptr_t kPage = 4096;
  const std::uintptr_t begin = (reinterpret_cast<std::uintptr_t>(heap) + kPage - 1) / kPage * kPage;
  madvise(reinterpret_cast<void*>(begin), kHeap - kPage, MADV_HUGEPAGE);  // NOLINT(performance-no-int-to-ptr)
  std::free(heap);
#endif
}

#ifdef __GLIBC__
/// Gives back what is neither written nor executed of a library; what is looked at again is read again.
int give_back_constants(dl_phdr_info* library, std::size_t /*size*/, void* /*nothing*/) {
  constexpr std::uintptr_t kWorthIt = 1 << 20, kPage = 4096;
  for (int k = 0; k < library->dlpi_phnum; ++k) {
    const ElfW(Phdr)& part = library->dlpi_phdr[k];
    if (part.p_type != PT_LOAD || part.p_flags != PF_R || part.p_filesz < kWorthIt) continue;
    const std::uintptr_t begin = (library->dlpi_addr + part.p_vaddr) / kPage * kPage;
    madvise(reinterpret_cast<void*>(begin), part.p_filesz, MADV_DONTNEED);  // NOLINT(performance-no-int-to-ptr)
  }
  return 0;
}
#endif

/// The names that libraries were linked by, 25 MB with OpenVDB, have been looked at by now, all of them (-z now), and
/// would stay in memory to the end.
void forget_names() {
#ifdef __GLIBC__
  dl_iterate_phdr(give_back_constants, nullptr);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  forget_names();
  keep_small_arrays();
  return_large_arrays();
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
