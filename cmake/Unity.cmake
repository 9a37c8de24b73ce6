# Sources of one folder compiled together: half the compiler's work for a build from scratch. A change of one source takes
# more: who works on one room for a day sets LAMINA_UNITY=OFF. A forgotten #include shows then, and in scripts/includes.
if(DEFINED ENV{LAMINA_UNITY})
  set(LAMINA_UNITY_DEFAULT $ENV{LAMINA_UNITY})
else()
  set(LAMINA_UNITY_DEFAULT ON)
endif()
option(LAMINA_UNITY "Compile the sources of a folder together" ${LAMINA_UNITY_DEFAULT})

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
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP "${room}")
  endforeach()
endfunction()
