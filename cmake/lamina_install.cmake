# cmake --install: the programs, the static libraries, their headers, and what find_package(lamina) reads.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set_target_properties(lamina_stages PROPERTIES EXPORT_NAME stages)
set_target_properties(lamina_pipeline PROPERTIES EXPORT_NAME pipeline)
install(TARGETS lamina lamina-preview COMPONENT program)
if(LAMINA_SCAN)
  install(TARGETS lamina-scan COMPONENT scan)
endif()
install(TARGETS lamina_stages lamina_pipeline EXPORT lamina-targets COMPONENT development)
# The public interface: pipeline/lamina.h and the headers that it includes, nothing else.
function(lamina_installed_header header)
  get_property(detected GLOBAL PROPERTY lamina_installed_headers)
  if(header IN_LIST detected)
    return()
  endif()
  set_property(GLOBAL APPEND PROPERTY lamina_installed_headers ${header})
  set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${header})
  get_filename_component(folder ${header} DIRECTORY)
  install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/lamina/${folder} COMPONENT development)
  file(STRINGS ${header} includes REGEX "^#include \"(pipeline|stages)/")
  foreach(line ${includes})
    string(REGEX REPLACE "^#include \"([^\"]*)\".*" "\\1" included "${line}")
    lamina_installed_header(${included})
  endforeach()
endfunction()

if(EXISTS ${PROJECT_SOURCE_DIR}/pipeline/lamina.h)
  lamina_installed_header(pipeline/lamina.h)
else()
  install(DIRECTORY stages pipeline DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/lamina COMPONENT development
          FILES_MATCHING PATTERN "*.h")
endif()
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(FILES packaging/lamina-watch@.service DESTINATION lib/systemd/system COMPONENT program)
install(FILES packaging/watch.conf DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples COMPONENT program)
# The pages that the help and the manual pages name.
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program FILES_MATCHING PATTERN "*.md"
        PATTERN "*.png" PATTERN "*.svg" PATTERN "*.toml")

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/lamina)
install(EXPORT lamina-targets NAMESPACE lamina:: DESTINATION ${package_dir} COMPONENT development)
configure_package_config_file(cmake/lamina-config.cmake.in ${PROJECT_BINARY_DIR}/lamina-config.cmake
                              INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/lamina-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/lamina-config.cmake ${PROJECT_BINARY_DIR}/lamina-config-version.cmake
        DESTINATION ${package_dir} COMPONENT development)
