# Tests: each folder of tests/ with C++ sources is a program test_<folder>, of all test_*.cpp below it and what they share.
if(NOT LAMINA_TESTS)
  return()
endif()
enable_testing()
find_package(GTest REQUIRED)
include(GoogleTest)

set_source_files_properties(${PROJECT_SOURCE_DIR}/tests/raster/reference.cpp
                            PROPERTIES COMPILE_OPTIONS -O3 SKIP_PRECOMPILE_HEADERS ON)

# What runs the program itself, for the tests of any folder.
set(test_support_sources ${PROJECT_SOURCE_DIR}/tests/commands/job_folder.cpp ${PROJECT_SOURCE_DIR}/tests/commands/program.cpp)
add_library(lamina_test_support STATIC ${test_support_sources})
target_link_libraries(lamina_test_support PUBLIC lamina::pipeline GTest::gtest nlohmann_json::nlohmann_json)
target_compile_definitions(lamina_test_support PUBLIC LAMINA_TEST_DIR="${PROJECT_SOURCE_DIR}/tests"
                           LAMINA_PROGRAM="$<TARGET_FILE:lamina>")
# Tests are compiled to be compiled fast; what they call is optimised, and so is the slow reference of the bitmaps.
target_compile_options(lamina_test_support PUBLIC $<$<NOT:$<CONFIG:Debug>>:-O1> -fno-sanitize=undefined
                       -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)  # g++ 12 has them wrong for std::string at -O1
target_precompile_headers(lamina_test_support PRIVATE tests/precompiled.h)

# Loaded before the program, to see what it syncs and renames.
add_library(lamina_call_log MODULE EXCLUDE_FROM_ALL tests/commands/call_log.cc)
set_target_properties(lamina_call_log PROPERTIES PREFIX "" OUTPUT_NAME call_log)

lamina_sources(all_test_sources "tests/*.cpp")
list(TRANSFORM all_test_sources REPLACE "^${PROJECT_SOURCE_DIR}/tests/([^/]*)/.*$" "\\1" OUTPUT_VARIABLE folders)
list(REMOVE_DUPLICATES folders)
foreach(folder ${folders})
  if(NOT LAMINA_TEST_COMMANDS AND folder MATCHES "commands|picture")
    continue()
  endif()
  lamina_sources(test_sources "tests/${folder}/*.cpp")
  list(REMOVE_ITEM test_sources ${test_support_sources} ${PROJECT_SOURCE_DIR}/tests/fuzz/libfuzzer.cpp)
  if(NOT (LAMINA_SCAN AND LAMINA_TEST_COMMANDS))
    list(FILTER test_sources EXCLUDE REGEX "/tests/calibration/scan/")
  endif()
  if(LAMINA_TEST_ONLY)
    list(FILTER test_sources INCLUDE REGEX "${LAMINA_TEST_ONLY}")
    if(NOT test_sources)
      continue()
    endif()
  endif()
  add_executable(test_${folder} ${test_sources})
  target_link_libraries(test_${folder} PRIVATE lamina_test_support GTest::gtest_main TIFF::TIFF PNG::PNG ZLIB::ZLIB
                        PkgConfig::LIBZIP PkgConfig::GMPXX PkgConfig::XXHASH)
  target_precompile_headers(test_${folder} REUSE_FROM lamina_test_support)
  if(LAMINA_UNITE_TESTS)
    list(REMOVE_ITEM test_sources ${PROJECT_SOURCE_DIR}/tests/raster/reference.cpp)  # options of its own
    lamina_unite(test_${folder} ${test_sources})
    list(FILTER test_sources INCLUDE REGEX "/tests/pipeline/")
    list(FILTER test_sources EXCLUDE REGEX "/tests/pipeline/(cli|run)/")  # the other rooms have a file or two each
    if(test_sources)
      set_source_files_properties(${test_sources} PROPERTIES UNITY_GROUP tests_pipeline)
    endif()
  endif()
  add_dependencies(test_${folder} lamina)
  if(LAMINA_TEST_COMMANDS AND NOT LAMINA_TEST_ONLY)
    add_dependencies(test_${folder} lamina-preview lamina_call_log)
    if(LAMINA_SCAN)
      add_dependencies(test_${folder} lamina-scan)
    endif()
  endif()
  if(folder STREQUAL "calibration" AND LAMINA_SCAN AND LAMINA_TEST_COMMANDS)
    target_link_libraries(test_${folder} PRIVATE lamina_scan)
    add_dependencies(test_${folder} lamina-scan)
  endif()
  if(folder STREQUAL "picture")
    target_link_libraries(test_${folder} PRIVATE PkgConfig::OPENIMAGEIO)
  endif()
  gtest_discover_tests(test_${folder} DISCOVERY_TIMEOUT 120 PROPERTIES TIMEOUT 900)
endforeach()

# What needs a release: other projects, other languages, other machines.
if(LAMINA_SANITIZE)
  return()
endif()
find_program(PYTHON3 python3 REQUIRED)
add_test(NAME Installed.AnotherProjectFindsTheLibraryAndPlansAPart
         COMMAND ${PROJECT_SOURCE_DIR}/tests/install/example ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR})
set_tests_properties(Installed.AnotherProjectFindsTheLibraryAndPlansAPart PROPERTIES TIMEOUT 900)
add_test(NAME Documentation.EveryExampleOfEveryCommandRuns
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/documentation/examples $<TARGET_FILE:lamina> ${PROJECT_SOURCE_DIR})
add_test(NAME Threemf.FilesOfOtherProgramsEndAsTheTableSays
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/scripts/threemf_outcomes ${PROJECT_SOURCE_DIR}/tests/corpus/3mf
                 --program $<TARGET_FILE:lamina>)
add_test(NAME Threemf.OtherProgramsOpenWhatLaminaWrites
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/formats/threemf_judges $<TARGET_FILE:lamina>)
add_test(NAME Golden.EveryJobWritesTheBytesOfTheTable
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/golden/check $<TARGET_FILE:lamina>)
add_test(NAME Cluster.SharesOnSlurmAreOneRunThoughAWorkerIsKilled
         COMMAND ${PROJECT_SOURCE_DIR}/tests/cluster/slurm $<TARGET_FILE:lamina>)
set_tests_properties(Cluster.SharesOnSlurmAreOneRunThoughAWorkerIsKilled PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 900)
# The longest begin first, so that no core waits for the last of them.
set_tests_properties(Installed.AnotherProjectFindsTheLibraryAndPlansAPart Documentation.EveryExampleOfEveryCommandRuns
                     Golden.EveryJobWritesTheBytesOfTheTable PROPERTIES COST 100)
if(LAMINA_PYTHON)
  add_test(NAME Python.ArraysAreTheDecodedFilesOfTheProgram
           COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/python/test_module.py $<TARGET_FILE:lamina>)
  set_tests_properties(Python.ArraysAreTheDecodedFilesOfTheProgram PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 300
                       ENVIRONMENT "PYTHONPATH=${PROJECT_BINARY_DIR}/python;PYTHONDONTWRITEBYTECODE=1")
endif()
