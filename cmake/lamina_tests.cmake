# Tests: each folder of tests/ with C++ sources is a program test_<folder>, of all test_*.cpp below it and what they share.
if(NOT LAMINA_TESTS)
  return()
endif()
enable_testing()
find_package(GTest REQUIRED)

set_source_files_properties(${PROJECT_SOURCE_DIR}/tests/raster/reference.cpp
                            PROPERTIES COMPILE_OPTIONS -O3 SKIP_PRECOMPILE_HEADERS ON)

# What runs the program itself, for the tests of any folder.
set(test_support_sources ${PROJECT_SOURCE_DIR}/tests/commands/job_folder.cpp ${PROJECT_SOURCE_DIR}/tests/commands/program.cpp)
add_library(lamina_test_support STATIC ${test_support_sources})
target_link_libraries(lamina_test_support PUBLIC lamina::pipeline GTest::gtest nlohmann_json::nlohmann_json)
target_compile_definitions(lamina_test_support PUBLIC LAMINA_TEST_DIR="${PROJECT_SOURCE_DIR}/tests"
                           LAMINA_PROGRAM="$<TARGET_FILE:lamina>")
# Tests are compiled without optimisation, in two thirds of the time; what they call is optimised, and so is the slow reference of the bitmaps.
# A library's options come after the program's own: a program that is optimised says so by a property.
target_compile_options(lamina_test_support PUBLIC $<IF:$<BOOL:$<TARGET_PROPERTY:LAMINA_OPTIMISED>>,-O1,-O0> -fno-sanitize=undefined)
if(LAMINA_PRECOMPILE AND NOT CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache")  # as in lamina_targets.cmake
  target_precompile_headers(lamina_test_support PRIVATE tests/precompiled.h)
endif()

# Loaded before the program, to see what it syncs and renames.
add_library(lamina_call_log MODULE EXCLUDE_FROM_ALL tests/commands/call_log.cc)
set_target_properties(lamina_call_log PROPERTIES PREFIX "" OUTPUT_NAME call_log)

# CI runs each test program in one of its two builds, g++ release or clang with sanitizers: programs whose result depends on
# optimisation in both, whole commands, long runs and what loads OpenImageIO or OpenCV in the release.
set(lamina_test_both raster coverage load geometry stokes formats)
set(lamina_test_release commands picture calibration run pores_of_jobs bead cost dose pores segment slice heights)
# Whose own code is most of their time, brute force: optimised in the sanitized build, where that takes less than it saves.
set(lamina_test_optimised checks coverage program)

lamina_sources(all_test_sources "tests/*.cpp")
list(REMOVE_ITEM all_test_sources ${test_support_sources} ${PROJECT_SOURCE_DIR}/tests/fuzz/libfuzzer.cpp)
list(TRANSFORM all_test_sources REPLACE "^${PROJECT_SOURCE_DIR}/tests/([^/]*)/.*$" "\\1" OUTPUT_VARIABLE folders)
list(REMOVE_DUPLICATES folders)
foreach(folder run pores_of_jobs ${folders})
  set(test_sources ${all_test_sources})
  if(folder STREQUAL "run")  # the rooms of the pipeline are one program, whole runs and pores of whole jobs others
    list(FILTER test_sources INCLUDE REGEX "/tests/pipeline/run/")
  elseif(folder STREQUAL "pores_of_jobs")
    list(FILTER test_sources INCLUDE REGEX "/tests/pipeline/pores/")
  else()
    list(FILTER test_sources INCLUDE REGEX "/tests/${folder}/")
    list(FILTER test_sources EXCLUDE REGEX "/tests/pipeline/(run|pores)/")
  endif()
  if(NOT LAMINA_SCAN)
    list(FILTER test_sources EXCLUDE REGEX "/tests/calibration/scan/")
  endif()
  if(LAMINA_TEST_ONLY)
    list(FILTER test_sources INCLUDE REGEX "${LAMINA_TEST_ONLY}")
  endif()
  set(side sanitized)
  if(folder IN_LIST lamina_test_release)
    set(side release)
  endif()
  if(NOT test_sources
     OR (LAMINA_TEST_SIDE AND NOT side STREQUAL LAMINA_TEST_SIDE AND NOT folder IN_LIST lamina_test_both))
    continue()
  endif()
  add_executable(test_${folder} ${test_sources})
  target_link_libraries(test_${folder} PRIVATE lamina_test_support GTest::gtest_main TIFF::TIFF PNG::PNG ZLIB::ZLIB
                        PkgConfig::LIBZIP PkgConfig::GMPXX PkgConfig::XXHASH PkgConfig::ZSTD)
  lamina_libraries_first(test_${folder})
  if(LAMINA_SANITIZE AND folder IN_LIST lamina_test_optimised)
    set_target_properties(test_${folder} PROPERTIES LAMINA_OPTIMISED ON)
  elseif(LAMINA_PRECOMPILE AND NOT CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache")
    target_precompile_headers(test_${folder} REUSE_FROM lamina_test_support)
  endif()
  if(LAMINA_UNITY_TESTS)
    list(REMOVE_ITEM test_sources ${PROJECT_SOURCE_DIR}/tests/raster/reference.cpp)  # options of its own
    lamina_unity(test_${folder} ${test_sources})
    list(FILTER test_sources INCLUDE REGEX "/tests/pipeline/")
    list(FILTER test_sources EXCLUDE REGEX "/tests/pipeline/(cli|run|pores)/")  # the other rooms have a file or two each
    if(test_sources)
      set_source_files_properties(${test_sources} PROPERTIES UNITY_GROUP tests_pipeline)
    endif()
  endif()
  add_dependencies(test_${folder} lamina)
  if(NOT LAMINA_TEST_ONLY)
    add_dependencies(test_${folder} lamina-preview)
  endif()
  if(NOT LAMINA_TEST_SIDE STREQUAL "sanitized" AND NOT LAMINA_TEST_ONLY)
    add_dependencies(test_${folder} lamina_call_log)
    if(LAMINA_SCAN)
      add_dependencies(test_${folder} lamina-scan)
    endif()
  endif()
  if(folder STREQUAL "calibration" AND LAMINA_SCAN)
    target_link_libraries(test_${folder} PRIVATE lamina_scan)
  endif()
  if(folder STREQUAL "picture")
    target_link_libraries(test_${folder} PRIVATE PkgConfig::OPENIMAGEIO)
  endif()
  # One process for each program; scripts/run_tests splits it into shards and reports each test.
  add_test(NAME test_${folder} COMMAND test_${folder})
  set_tests_properties(test_${folder} PROPERTIES LABELS gtest TIMEOUT 1800)
endforeach()

# What hands work and files from thread to thread, and no more: the graph, the queue of batches, writers of files and their
# tests. CI builds this program with the thread sanitizer (scripts/check_threads --changed).
if(LAMINA_SANITIZE STREQUAL "thread")
  set(thread_sources)
  foreach(pattern "pipeline/flow/*.cpp" "pipeline/batch/*.cpp" "stages/support/io/file*.cpp" "stages/support/io/journal.cpp"
                  "tests/pipeline/flow/*.cpp" "tests/pipeline/batch/*.cpp" "tests/support/test_file.cpp" "tests/support/test_journal.cpp"
                  "tests/support/test_replaceable.cpp")
    lamina_sources(found ${pattern})
    if(NOT found)
      message(FATAL_ERROR "test_threads: no file matches ${pattern}")
    endif()
    list(FILTER found EXCLUDE REGEX "/pipeline/batch/check_batch\\.cpp$")  # verifies whole jobs, which is all of the pipeline
    list(APPEND thread_sources ${found})
  endforeach()
  list(REMOVE_DUPLICATES thread_sources)
  lamina_add_included(thread_sources)
  add_executable(test_threads EXCLUDE_FROM_ALL ${thread_sources})
  target_include_directories(test_threads PRIVATE ${PROJECT_SOURCE_DIR})
  target_include_directories(test_threads SYSTEM PRIVATE ${lamina_late_headers})
  target_link_libraries(test_threads PRIVATE TBB::tbb Eigen3::Eigen fmt::fmt PNG::PNG ZLIB::ZLIB EXPAT::EXPAT PkgConfig::POLYCLIPPING
                        PkgConfig::MUPARSER PkgConfig::GMPXX PkgConfig::XXHASH PkgConfig::ZSTD nlohmann_json::nlohmann_json TIFF::TIFF GTest::gtest_main
                        ${CMAKE_DL_LIBS})
  target_compile_definitions(test_threads PRIVATE $<TARGET_PROPERTY:lamina_test_support,INTERFACE_COMPILE_DEFINITIONS>)
  list(FILTER thread_sources EXCLUDE REGEX "/(cli/commands/plan|job/profiles/printer)\\.cpp$")  # names of their own
  lamina_unity(test_threads ${thread_sources})
endif()

# What needs a release: other projects, other languages, other machines.
if(LAMINA_SANITIZE OR LAMINA_TEST_SIDE STREQUAL "sanitized")
  return()
endif()
find_program(PYTHON3 python3 REQUIRED)
add_test(NAME Installed.AnotherProjectFindsTheLibraryAndPlansAPart
         COMMAND ${PROJECT_SOURCE_DIR}/tests/install/example ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR})
set_tests_properties(Installed.AnotherProjectFindsTheLibraryAndPlansAPart PROPERTIES TIMEOUT 900)
add_test(NAME Configured.TheSummaryListsWhatIsLeftOutAndWhy
         COMMAND ${PROJECT_SOURCE_DIR}/tests/install/summary ${PROJECT_SOURCE_DIR})
add_test(NAME Documentation.EveryExampleOfEveryCommandRuns
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/documentation/examples $<TARGET_FILE:lamina> ${PROJECT_SOURCE_DIR})
add_test(NAME Documentation.EveryCommandOfTheGuidesPrintsWhatTheySay
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/documentation/guides $<TARGET_FILE:lamina> ${PROJECT_SOURCE_DIR})
add_test(NAME Documentation.EveryKeyOfJsonOutputIsOnItsPage
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/documentation/json_keys $<TARGET_FILE:lamina> ${PROJECT_SOURCE_DIR})
add_test(NAME Threemf.FilesOfOtherProgramsEndAsTheTableSays
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/scripts/threemf_outcomes ${PROJECT_SOURCE_DIR}/tests/corpus/3mf
                 --program $<TARGET_FILE:lamina>)
add_test(NAME Threemf.OtherProgramsOpenWhatLaminaWrites
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/formats/threemf_checkers $<TARGET_FILE:lamina>)
add_test(NAME PrintTime.IsThatOfTheSimulatedPlanners
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/segment/print_time $<TARGET_FILE:lamina>)
add_test(NAME Golden.EveryJobWritesTheBytesOfTheTable
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/golden/check $<TARGET_FILE:lamina>)
add_test(NAME Cluster.SharesOnSlurmAreOneRunThoughAWorkerIsKilled
         COMMAND ${PROJECT_SOURCE_DIR}/tests/cluster/slurm $<TARGET_FILE:lamina>)
add_test(NAME Cluster.AListInSharesOnSlurmIsOneBatchThoughAWorkerIsKilled
         COMMAND ${PROJECT_SOURCE_DIR}/tests/cluster/slurm_batch $<TARGET_FILE:lamina>)
add_test(NAME Cluster.CommandsOfTheKubernetesFileAreOneBatch
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/cluster/kubernetes_batch $<TARGET_FILE:lamina>)
add_test(NAME Cluster.TheDaskBlockOfTheGuideIsOneBatch COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/cluster/dask_batch $<TARGET_FILE:lamina>)
set_tests_properties(Cluster.SharesOnSlurmAreOneRunThoughAWorkerIsKilled Cluster.AListInSharesOnSlurmIsOneBatchThoughAWorkerIsKilled
                     Cluster.CommandsOfTheKubernetesFileAreOneBatch Cluster.TheDaskBlockOfTheGuideIsOneBatch PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 900)
add_test(NAME Watch.NoPartIsLostOrPlannedTwiceThoughTheWatcherIsKilled
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/watch/torture $<TARGET_FILE:lamina>)
# The longest begin first, so that no core waits for the last of them.
set_tests_properties(Installed.AnotherProjectFindsTheLibraryAndPlansAPart Documentation.EveryExampleOfEveryCommandRuns
                     Documentation.EveryCommandOfTheGuidesPrintsWhatTheySay Golden.EveryJobWritesTheBytesOfTheTable PROPERTIES COST 100)
if(LAMINA_PYTHON)
  add_test(NAME Python.ArraysAreTheDecodedFilesOfTheProgram
           COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/python/test_module.py $<TARGET_FILE:lamina>)
  set_tests_properties(Python.ArraysAreTheDecodedFilesOfTheProgram PROPERTIES SKIP_RETURN_CODE 77 TIMEOUT 300
                       ENVIRONMENT "PYTHONPATH=${PROJECT_BINARY_DIR}/python;PYTHONDONTWRITEBYTECODE=1")
endif()
add_test(NAME Formats.FilesOfPublicReportsAreReadAsTheirFormatsSay
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/formats/reported_files $<TARGET_FILE:lamina> ${PROJECT_SOURCE_DIR})
add_test(NAME Formats.LayersAreTheSameAfterPackersOfPng
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/formats/packed_images $<TARGET_FILE:lamina> ${PROJECT_SOURCE_DIR} 4)
set_tests_properties(Formats.LayersAreTheSameAfterPackersOfPng PROPERTIES SKIP_RETURN_CODE 77)
add_test(NAME Engines.AHorizontalFaceOfAnyFileIsInALayerOrIsNot
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/raster/tilted_slabs $<TARGET_FILE:lamina>)
if(LAMINA_PYTHON AND LAMINA_SCAN)
  add_test(NAME Photographs.StripesAndOffsetsAreReadFromImagesOfAnotherProgram
           COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/tests/calibration/photographs/series $<TARGET_FILE:lamina>)
  set_tests_properties(Photographs.StripesAndOffsetsAreReadFromImagesOfAnotherProgram PROPERTIES SKIP_RETURN_CODE 77)
endif()
add_test(NAME Documentation.EveryQuestionHasItsAnswerNearTheIndex
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/documentation/questions ${PROJECT_SOURCE_DIR})
add_test(NAME Documentation.EveryFigureOfTheReadmeIsInAPageOfItsCommit
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/documentation/figures ${PROJECT_SOURCE_DIR})
add_test(NAME Bench.APeerOfAnyProgramIsRunAndItsPixelsAreCompared
         COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/bench/test_mslicer $<TARGET_FILE:lamina>)
add_test(NAME House.EveryRuleFindsThePlantedFault COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/house/test_check_house)
add_test(NAME Landing.FilesOfThreeCommitsAreFound COMMAND ${PYTHON3} ${PROJECT_SOURCE_DIR}/tests/landing/three_commits ${PROJECT_SOURCE_DIR})
