# Flags shared by every target of the project; dependencies' headers are SYSTEM and stay silent.
add_library(lamina_flags INTERFACE)
target_compile_options(lamina_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
  # GCC 12 sees overlapping copies in plain string concatenation (its bug 105651).
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-restrict>
  # Identity: no fused multiply-add, so every processor kind computes the same bits.
  -ffp-contract=off
  # Lets the compiler vectorise the kernels; neither changes a value.
  -fno-math-errno -fno-trapping-math)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  # The oldest processor the kernels run on; masks are counted everywhere, and this has an instruction for it.
  target_compile_options(lamina_flags INTERFACE -march=x86-64-v2)
endif()
if(LAMINA_WERROR)
  target_compile_options(lamina_flags INTERFACE -Werror)
endif()
if(LAMINA_SANITIZE)
  # The instrumentation hides from GCC that a value is set: it warns without cause.
  target_compile_options(lamina_flags INTERFACE
    -fsanitize=${LAMINA_SANITIZE} -fno-omit-frame-pointer -Wno-maybe-uninitialized
    # For targets whose own arithmetic is not under suspicion: its checks take the compiler a third of its time.
    $<$<BOOL:$<TARGET_PROPERTY:LAMINA_ARITHMETIC_UNCHECKED>>:-fno-sanitize=undefined>)
  target_link_options(lamina_flags INTERFACE -fsanitize=${LAMINA_SANITIZE})
  if(LAMINA_SANITIZE MATCHES thread)
    # TBB's library is not instrumented: its orders are told to the sanitizer.
    target_compile_options(lamina_flags INTERFACE -include ${PROJECT_SOURCE_DIR}/tests/tsan/annotated_tbb.h)
    target_link_options(lamina_flags INTERFACE -Wl,--version-script=${PROJECT_SOURCE_DIR}/tests/tsan/exports)
  endif()
endif()

# For libraries that become part of a shared object, the Python module, too. Calls and inlining stay what they are in a program.
function(lamina_position_independent target)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(${target} PRIVATE -fno-semantic-interposition)
endfunction()
