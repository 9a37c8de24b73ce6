# What the project exports: the library with its public headers, the program, and a package that find_package(Lamina) finds.
include(CMakePackageConfigHelpers)
set(LAMINA_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/Lamina)

install(TARGETS lamina EXPORT LaminaTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS lamina_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/lamina DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY ${PROJECT_BINARY_DIR}/share/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 FILES_MATCHING PATTERN "*.1")
install(FILES ${PROJECT_BINARY_DIR}/share/lamina.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
  RENAME lamina)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

install(EXPORT LaminaTargets NAMESPACE Lamina:: DESTINATION ${LAMINA_PACKAGE_DIR})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/LaminaConfig.cmake.in
  ${PROJECT_BINARY_DIR}/LaminaConfig.cmake INSTALL_DESTINATION ${LAMINA_PACKAGE_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/LaminaConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/LaminaConfig.cmake ${PROJECT_BINARY_DIR}/LaminaConfigVersion.cmake
  DESTINATION ${LAMINA_PACKAGE_DIR})
