# cmake --install: the programs, the static libraries, their headers, and what find_package(lamina) reads.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set_target_properties(lamina_stages PROPERTIES EXPORT_NAME stages)
set_target_properties(lamina_pipeline PROPERTIES EXPORT_NAME pipeline)
install(TARGETS lamina lamina-preview COMPONENT program)
install(TARGETS lamina_stages lamina_pipeline EXPORT lamina-targets COMPONENT development)
install(DIRECTORY stages pipeline DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/lamina COMPONENT development
        FILES_MATCHING PATTERN "*.h")
install(FILES LICENSE README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/lamina)
install(EXPORT lamina-targets NAMESPACE lamina:: DESTINATION ${package_dir} COMPONENT development)
configure_package_config_file(cmake/lamina-config.cmake.in ${PROJECT_BINARY_DIR}/lamina-config.cmake
                              INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/lamina-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/lamina-config.cmake ${PROJECT_BINARY_DIR}/lamina-config-version.cmake
        DESTINATION ${package_dir} COMPONENT development)
