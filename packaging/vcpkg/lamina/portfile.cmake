# Port of the checkout that it lies in: vcpkg install lamina --overlay-ports=packaging/vcpkg
# Written, not run: there was no vcpkg to try it with.
get_filename_component(SOURCE_PATH "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
vcpkg_find_acquire_program(PKGCONFIG)
vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS
    -DLAMINA_TESTS=OFF
    -DLAMINA_WITH_MPI=OFF
    "-DPKG_CONFIG_EXECUTABLE=${PKGCONFIG}"
)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(PACKAGE_NAME Lamina CONFIG_PATH lib/cmake/Lamina)
vcpkg_copy_tools(TOOL_NAMES lamina AUTO_CLEAN)
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug/include" "${CURRENT_PACKAGES_DIR}/debug/share")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
