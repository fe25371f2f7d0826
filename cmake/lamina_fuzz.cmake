# Fuzz targets (tests/fuzz/README.md): programs for libFuzzer, one for each file of targets. The preset `fuzz` has the
# compiler and the sanitizers; only what readers need is compiled.
option(LAMINA_FUZZ "Build the fuzz targets; wants clang" OFF)
if(NOT LAMINA_FUZZ)
  return()
endif()

# All other programs and libraries wait until they are asked for.
get_property(others DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
set_target_properties(${others} PROPERTIES EXCLUDE_FROM_ALL ON)

lamina_sources(fuzzed "stages/data/*.cpp" "stages/support/*.cpp" "stages/geometry/*.cpp" "stages/load/*.cpp"
               "stages/replay/*.cpp" "stages/program/*.cpp" "stages/heights/*.cpp" "stages/segment/*.cpp"
               "stages/infill/*.cpp" "stages/formats/*.cpp" "pipeline/manifest/*.cpp" "pipeline/job/*.cpp" "pipeline/machine/*.cpp")
lamina_add_included(fuzzed)
add_library(lamina_fuzzed STATIC ${fuzzed} ${PROJECT_BINARY_DIR}/shipped_machines.cpp ${PROJECT_BINARY_DIR}/shipped_presets.cpp
                                 ${PROJECT_BINARY_DIR}/shipped_extruders.cpp tests/fuzz/target.cpp tests/fuzz/laws.cpp)
target_include_directories(lamina_fuzzed PUBLIC ${PROJECT_SOURCE_DIR})
target_link_libraries(lamina_fuzzed PUBLIC TBB::tbb Eigen3::Eigen fmt::fmt PNG::PNG ZLIB::ZLIB EXPAT::EXPAT
                      PkgConfig::POLYCLIPPING PkgConfig::MUPARSER PkgConfig::GMPXX PkgConfig::XXHASH nlohmann_json::nlohmann_json
                      ${CMAKE_DL_LIBS})
target_include_directories(lamina_fuzzed SYSTEM PUBLIC ${lamina_late_headers})
target_compile_options(lamina_fuzzed PUBLIC -fsanitize=fuzzer-no-link -fno-sanitize-recover=all)
if(LAMINA_UNITE STREQUAL "all")
  list(FILTER fuzzed EXCLUDE REGEX "/(load/stl_ascii|load/stl_binary|job/profiles/printer|job/extrude)\\.cpp$")  # names of their own
  lamina_unite(lamina_fuzzed ${fuzzed})
endif()
target_precompile_headers(lamina_fuzzed PRIVATE cmake/precompiled.h)

add_library(lamina_libfuzzer OBJECT tests/fuzz/libfuzzer.cpp)
target_link_libraries(lamina_libfuzzer PRIVATE lamina_fuzzed)
foreach(targets meshes threemf jobs profiles manifest lists charts gcode programs images tables texts)
  add_executable(fuzz_${targets} tests/fuzz/${targets}.cpp $<TARGET_OBJECTS:lamina_libfuzzer>)
  target_link_libraries(fuzz_${targets} PRIVATE lamina_fuzzed)
  target_link_options(fuzz_${targets} PRIVATE -fsanitize=fuzzer)
endforeach()
