# What the project exports: the library with its public headers, the program, and a package that find_package(Lamina) finds.
# Component `program` is what a user runs, `development` what a programmer builds on; `cmake --install` takes both.
include(CMakePackageConfigHelpers)
set(LAMINA_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/Lamina)
set(LAMINA_DOC_DIR ${CMAKE_INSTALL_DATAROOTDIR}/doc)

install(TARGETS lamina EXPORT LaminaTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(TARGETS lamina_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/lamina DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  COMPONENT development)
install(DIRECTORY ${PROJECT_BINARY_DIR}/share/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1
  COMPONENT program FILES_MATCHING PATTERN "*.1")
install(FILES ${PROJECT_BINARY_DIR}/share/lamina.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
  RENAME lamina COMPONENT program)
install(FILES ${PROJECT_BINARY_DIR}/share/lamina/viewer.js DESTINATION ${CMAKE_INSTALL_DATADIR}/lamina COMPONENT program OPTIONAL)
# Where Debian wants the licence of a package.
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${LAMINA_DOC_DIR}/lamina RENAME copyright COMPONENT program)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${LAMINA_DOC_DIR}/liblamina-dev RENAME copyright
  COMPONENT development)

install(EXPORT LaminaTargets NAMESPACE Lamina:: DESTINATION ${LAMINA_PACKAGE_DIR} COMPONENT development)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/LaminaConfig.cmake.in
  ${PROJECT_BINARY_DIR}/LaminaConfig.cmake INSTALL_DESTINATION ${LAMINA_PACKAGE_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/LaminaConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/LaminaConfig.cmake ${PROJECT_BINARY_DIR}/LaminaConfigVersion.cmake
  DESTINATION ${LAMINA_PACKAGE_DIR} COMPONENT development)
