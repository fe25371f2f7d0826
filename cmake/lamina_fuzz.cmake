# Fuzz targets (tests/fuzz/README.md): one program for libFuzzer with a target for each reader. It links the libraries of the
# build, which clang instruments for sanitizers and for libFuzzer (preset asan).
option(LAMINA_FUZZ "Build the fuzz targets; needs clang" OFF)
if(NOT LAMINA_FUZZ)
  return()
endif()

foreach(library ${lamina_libraries})
  target_compile_options(${library} PRIVATE -fsanitize=fuzzer-no-link
                         -fsanitize-coverage-ignorelist=${PROJECT_SOURCE_DIR}/cmake/without_coverage.txt)
endforeach()

lamina_sources(fuzz_sources "tests/fuzz/*.cpp")
list(REMOVE_ITEM fuzz_sources ${PROJECT_SOURCE_DIR}/tests/fuzz/test_corpus.cpp)
add_executable(fuzz_readers ${fuzz_sources})
target_link_libraries(fuzz_readers PRIVATE lamina::pipeline PNG::PNG ZLIB::ZLIB TIFF::TIFF PkgConfig::LIBZIP PkgConfig::XXHASH PkgConfig::ZSTD
                      nlohmann_json::nlohmann_json)
target_link_options(fuzz_readers PRIVATE -fsanitize=fuzzer)
lamina_libraries_first(fuzz_readers)
if(LAMINA_UNITY STREQUAL "all")
  lamina_unity(fuzz_readers ${fuzz_sources})
endif()
