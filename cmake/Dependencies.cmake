# Everything comes from Debian packages (scripts/setup). OpenVDB ships a find module instead of a package config.
list(APPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR} /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB)
set(CMAKE_POLICY_DEFAULT_CMP0057 NEW)
find_package(Threads REQUIRED)
find_package(TBB REQUIRED)
find_package(Imath REQUIRED)
find_package(OpenVDB REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(OpenMesh REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(BLOSC REQUIRED IMPORTED_TARGET blosc)
find_package(CLI11 REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(PNG REQUIRED)
find_package(ZLIB REQUIRED)
find_package(EXPAT REQUIRED)
find_package(meshoptimizer REQUIRED)  # compression of tiles
# Serves tiles to a browser on this machine; without it they go into pages only.
pkg_check_modules(HTTPLIB IMPORTED_TARGET cpp-httplib)
# Several machines on one mesh; without it the program runs alone.
option(LAMINA_WITH_MPI "Build with MPI where it is found" ON)
if(LAMINA_WITH_MPI)
  enable_language(C)  # CMake asks the C compiler for MPI's C interface
  find_package(MPI COMPONENTS C)
endif()
