# Installs the build to a fresh prefix, then configures and builds the consumer against it and runs it over CLOUD.
set(prefix ${WORK_DIR}/prefix)
file(REMOVE_RECURSE ${WORK_DIR})
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${WORK_DIR}/build -G ${GENERATOR}
    -DCMAKE_PREFIX_PATH=${prefix} -DWANTED_VERSION=${VERSION} -DCMAKE_BUILD_TYPE=Release)
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
run(${WORK_DIR}/build/consumer ${CLOUD} ${WORK_DIR}/mesh.ply)
run(${prefix}/bin/lamina check ${WORK_DIR}/mesh.ply --expect manifold)
run(${prefix}/bin/lamina --version)
