# Copies FROM to TO where there is such a file, and removes TO where there is none.
if(EXISTS ${FROM})
  configure_file(${FROM} ${TO} COPYONLY)
else()
  file(REMOVE ${TO})
endif()
