# Sources of one folder compiled together: half the compiler's work for a build from scratch, as the checks' builds are.
# By hand, one source after the other is quicker, and a forgotten #include shows (scripts/tidy sees each by itself, too).
option(LAMINA_UNITY "Compile the sources of a folder together" $ENV{LAMINA_UNITY})

function(lamina_unity target)
  if(NOT LAMINA_UNITY)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  # What is unnamed in a source counts as a header's there.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  get_target_property(sources ${target} SOURCES)
  foreach(source ${sources})
    cmake_path(GET source PARENT_PATH folder)
    cmake_path(GET folder FILENAME room)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${room})
  endforeach()
endfunction()
