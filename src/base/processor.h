// The kinds of x86-64 processors that kernels are compiled for, one source each time. All kinds give the same bits.
#pragma once

namespace lamina {

/// Each kind runs what is compiled for the ones before it.
enum class ProcessorKind { v2, v3, v4 };

/// Of the processor the program runs on.
ProcessorKind processor_kind();

/// The kind whose kernels are to be used: the processor's own, or what LAMINA_KERNEL in the environment asks for (v2,
/// v3 or v4). Throws Error(usage) where the processor is not of that kind.
ProcessorKind wanted_kind();

}  // namespace lamina
