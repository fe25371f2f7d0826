# Manual pages and shell completion, made by the program itself, and Debian packages: cpack in the build directory.
if(NOT LAMINA_SANITIZE)
  set(pages ${PROJECT_BINARY_DIR}/share)
  file(MAKE_DIRECTORY ${pages}/man)
  add_custom_command(
    OUTPUT ${pages}/done
    COMMAND lamina manual -o ${pages}/man
    COMMAND sh -c "gzip -9nkf man/*.1"
    COMMAND lamina completion bash > lamina.bash
    COMMAND lamina completion zsh > _lamina
    COMMAND lamina completion fish > lamina.fish
    COMMAND ${CMAKE_COMMAND} -E touch done
    WORKING_DIRECTORY ${pages}
    DEPENDS lamina
    COMMENT "Manual pages and shell completion"
    VERBATIM)
  add_custom_target(lamina_pages ALL DEPENDS ${pages}/done)
  install(DIRECTORY ${pages}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program FILES_MATCHING PATTERN "*.1.gz")
  set(share ${CMAKE_INSTALL_DATADIR})
  install(FILES ${pages}/lamina.bash DESTINATION ${share}/bash-completion/completions RENAME lamina COMPONENT program)
  install(FILES ${pages}/_lamina DESTINATION ${share}/zsh/vendor-completions COMPONENT program)
  install(FILES ${pages}/lamina.fish DESTINATION ${share}/fish/vendor_completions.d COMPONENT program)
endif()

# Packages: lamina (the programs), lamina-scan, liblamina-dev (static libraries, headers, find_package), python3-lamina (the module).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME lamina)
set(CPACK_PACKAGE_VENDOR lamina)
set(CPACK_PACKAGE_CONTACT "The lamina maintainers <maintainers@lamina.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL program development)
if(LAMINA_SCAN)
  list(APPEND CPACK_COMPONENTS_ALL scan)
  set(CPACK_DEBIAN_SCAN_PACKAGE_NAME lamina-scan)
  set(CPACK_DEBIAN_SCAN_PACKAGE_SECTION science)
  set(CPACK_DEBIAN_SCAN_PACKAGE_DEPENDS "lamina")
  set(CPACK_COMPONENT_SCAN_DESCRIPTION "The program lamina-scan, which reads photographs for lamina calibrate and lamina compare")
endif()
if(LAMINA_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# dpkg-shlibdeps does not detect libraries that the programs load when they first need them.
set(late_packages)
find_program(DPKG_QUERY dpkg-query)
mark_as_advanced(DPKG_QUERY)
if(DPKG_QUERY)
  foreach(file ${lamina_late_files})
    file(REAL_PATH ${file} file)
    execute_process(COMMAND ${DPKG_QUERY} -S ${file} OUTPUT_VARIABLE owner ERROR_QUIET)
    if(owner MATCHES "^([^:]+):")
      list(APPEND late_packages ${CMAKE_MATCH_1})
    endif()
  endforeach()
endif()
list(JOIN late_packages ", " late_packages)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "${late_packages}")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME lamina)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "fonts-dejavu-core")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "lamina-scan")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME liblamina-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "pkg-config, libtbb-dev, libeigen3-dev, libembree-dev, libfmt-dev, libtiff-dev, libpng-dev, zlib1g-dev, nlohmann-json3-dev, libxxhash-dev, libzstd-dev, libzip-dev, libexpat1-dev, libpolyclipping-dev, libmuparser-dev, libgmp-dev")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-lamina)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}), python3-numpy, ${late_packages}")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "The Python module lamina")
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "The programs lamina and lamina-preview")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Static libraries and headers of lamina")
include(CPack)
