# Libraries, programs and benchmarks. Sources are found by folder: a file belongs to the stage it lies in.

function(lamina_sources result)
  set(found)
  foreach(pattern ${ARGN})
    file(GLOB_RECURSE files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${pattern})
    list(APPEND found ${files})
  endforeach()
  set(${result} ${found} PARENT_SCOPE)
endfunction()

# Adds the sources of every header of stages/, pipeline/ and tests/ that the sources of a list include, however far down.
function(lamina_add_included list)
  set(sources ${${list}})
  set(waiting ${sources})
  set(detected)
  while(waiting)
    list(POP_FRONT waiting file)
    file(STRINGS ${file} lines REGEX "^#include \"(stages|pipeline|tests)/[^\"]+\\.h\"")
    foreach(line ${lines})
      string(REGEX REPLACE "^#include \"([^\"]+)\\.h\".*" "${PROJECT_SOURCE_DIR}/\\1" name "${line}")
      if(NOT name IN_LIST detected)
        list(APPEND detected ${name})
        list(APPEND waiting ${name}.h)
        # A header of kernels has a source for each instruction set.
        get_filename_component(base ${name} NAME)
        get_filename_component(folder ${name} DIRECTORY)
        if(base STREQUAL "kernels")
          file(GLOB found ${folder}/*.cpp)
        else()
          file(GLOB found ${name}.cpp ${name}_plain.cpp ${name}_avx2.cpp ${name}_avx512.cpp)
        endif()
        list(REMOVE_ITEM found ${sources})
        list(APPEND sources ${found})
        list(APPEND waiting ${found})
      endif()
    endforeach()
  endwhile()
  set(${list} ${sources} PARENT_SCOPE)
endfunction()

# Compiles the sources of a folder together, in half of the time, where no two of them use one name for different things.
function(lamina_unity target)
  foreach(source ${ARGN})
    get_filename_component(folder ${source} DIRECTORY)
    file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${folder})
    string(REGEX REPLACE "^stages/(formats|program|replay|support)/.*" "stages/\\1" folder ${folder})
    if(LAMINA_UNITY_SKIP AND folder MATCHES "${LAMINA_UNITY_SKIP}")
      set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
    string(MAKE_C_IDENTIFIER ${folder} folder)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${folder})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  target_compile_options(${target} PRIVATE -Wno-subobject-linkage)  # g++ takes what a file keeps to itself for a header's
endfunction()

# Links a program with the libraries before its own objects. Of an inline function that several objects contain the linker keeps the
# first: this way the one that the stages optimise, not that of a test at -O0 or of what runs once a job at -O1. Objects and not the
# archives, in which what runs once a job comes first.
function(lamina_libraries_first target)
  target_link_options(${target} BEFORE PRIVATE $<TARGET_OBJECTS:lamina_stages> $<TARGET_OBJECTS:lamina_pipeline>
                                               $<TARGET_OBJECTS:lamina_stages_once_a_job> $<TARGET_OBJECTS:lamina_once_a_job>)
endfunction()

include(GNUInstallDirs)

# --- stages: what is done
lamina_sources(stage_sources "stages/*.cpp")
list(FILTER stage_sources EXCLUDE REGEX "/stages/(view/picture|calibration/scan)/")
# What runs once a job or once a file is compiled to be compiled fast; what does the work of facets or layers is optimised.
set(stages_once_a_job ${stage_sources})
list(FILTER stages_once_a_job INCLUDE REGEX "/stages/(calibration/chart/|formats/(chart|plot)/|formats/image_format|formats/images/stack_info|\
load/(source|threemf/(archive|extensions|roles))|program/(dialect|maintenance|vats)|support/late/|\
support/text/(escape|json_|readable|toml|value)|view/(cast|drawable_layers|pore_picture|report/page))")
list(REMOVE_ITEM stage_sources ${stages_once_a_job})
add_library(lamina_stages_once_a_job OBJECT ${stages_once_a_job})

add_library(lamina_stages STATIC ${stage_sources} $<TARGET_OBJECTS:lamina_stages_once_a_job>)
add_library(lamina::stages ALIAS lamina_stages)
if(LAMINA_UNITY STREQUAL "all")
  lamina_unity(lamina_stages ${stage_sources})
  lamina_unity(lamina_stages_once_a_job ${stages_once_a_job})
endif()
foreach(library lamina_stages lamina_stages_once_a_job)
  target_include_directories(${library} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                               $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/lamina>)
  target_link_libraries(${library} PUBLIC TBB::tbb Eigen3::Eigen fmt::fmt
                        PRIVATE PNG::PNG ZLIB::ZLIB EXPAT::EXPAT PkgConfig::POLYCLIPPING PkgConfig::MUPARSER PkgConfig::GMPXX
                                PkgConfig::XXHASH PkgConfig::ZSTD nlohmann_json::nlohmann_json ${CMAKE_DL_LIBS})
endforeach()

# Embree, libtiff and libzip are loaded when a job first needs them (stages/support/late/late.h), by the names that linking
# would have written down.
set(lamina_late_files)
set(lamina_late_names)
foreach(name embree tiff zip)
  string(REPLACE "embree" "embree${embree_VERSION_MAJOR}" library ${name})
  find_library(lamina_${name}_file ${library} REQUIRED)
  mark_as_advanced(lamina_${name}_file)
  execute_process(COMMAND ${CMAKE_OBJDUMP} -p ${lamina_${name}_file} OUTPUT_VARIABLE sections COMMAND_ERROR_IS_FATAL ANY)
  if(NOT sections MATCHES "SONAME +([^ \n]+)")
    message(FATAL_ERROR "${lamina_${name}_file} is no shared library; lamina loads it when a job first needs it")
  endif()
  string(TOUPPER ${name} upper)
  list(APPEND lamina_late_names LAMINA_${upper}_FILE="${CMAKE_MATCH_1}")
  list(APPEND lamina_late_files ${lamina_${name}_file})
endforeach()
set_source_files_properties(${PROJECT_SOURCE_DIR}/stages/support/late/late.cpp PROPERTIES
                            COMPILE_DEFINITIONS "${lamina_late_names}" SKIP_PRECOMPILE_HEADERS ON)
set(lamina_late_headers $<TARGET_PROPERTY:embree,INTERFACE_INCLUDE_DIRECTORIES> ${TIFF_INCLUDE_DIRS} ${LIBZIP_INCLUDE_DIRS})
foreach(library lamina_stages lamina_stages_once_a_job)
  target_include_directories(${library} SYSTEM PRIVATE ${lamina_late_headers})
  target_compile_definitions(${library} PRIVATE LAMINA_EMBREE_MAJOR=${embree_VERSION_MAJOR})
endforeach()
set_source_files_properties(${PROJECT_SOURCE_DIR}/stages/support/text/version.cpp PROPERTIES
                            COMPILE_DEFINITIONS LAMINA_VERSION="${PROJECT_VERSION}" SKIP_PRECOMPILE_HEADERS ON)

# --- pipeline: how work moves
lamina_sources(pipeline_sources "pipeline/*.cpp")
list(FILTER pipeline_sources EXCLUDE REGEX "/pipeline/(main|preview_main|scan_main|calibrate/scan_answer|show/sheet)\\.cpp$")
# What runs once a job, or little once a layer, is compiled to be compiled fast; what does the work of layers or facets, and
# what decodes programs, is optimised.
lamina_sources(once_a_job "pipeline/batch/*.cpp" "pipeline/calibrate/*.cpp" "pipeline/cli/*.cpp" "pipeline/job/*.cpp"
               "pipeline/machine/*.cpp" "pipeline/manifest/*.cpp" "pipeline/plan/plan.cpp" "pipeline/plan/progress.cpp"
               "pipeline/plan/solids.cpp" "pipeline/pores/*.cpp" "pipeline/report/*.cpp" "pipeline/show/*.cpp")
list(FILTER once_a_job EXCLUDE REGEX "/(calibrate/scan_answer|show/sheet|report/part_info|report/heights_study)\\.cpp$")
list(REMOVE_ITEM pipeline_sources ${once_a_job})
add_library(lamina_once_a_job OBJECT ${once_a_job})
target_link_libraries(lamina_once_a_job PRIVATE lamina::stages nlohmann_json::nlohmann_json)
foreach(library lamina_stages_once_a_job lamina_once_a_job)
  target_compile_options(${library} PRIVATE $<$<NOT:$<CONFIG:Debug>>:-O1>)
  if(LAMINA_SANITIZE MATCHES "address" AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # The same checks as calls instead of in place: slower to run, compiled in two thirds of the time.
    target_compile_options(${library} PRIVATE --param=asan-instrumentation-with-call-threshold=0)
  endif()
endforeach()
if(LAMINA_UNITY)
  set(merged ${once_a_job})
  list(FILTER merged EXCLUDE REGEX "/(cli/commands/plan|job/profiles/printer)\\.cpp$")
  lamina_unity(lamina_once_a_job ${merged})
endif()

add_library(lamina_pipeline STATIC ${pipeline_sources} $<TARGET_OBJECTS:lamina_once_a_job>)
add_library(lamina::pipeline ALIAS lamina_pipeline)
target_link_libraries(lamina_pipeline PUBLIC lamina::stages PRIVATE nlohmann_json::nlohmann_json)
if(LAMINA_UNITY STREQUAL "all")
  lamina_unity(lamina_pipeline ${pipeline_sources})
endif()

# ccache keeps nothing that was made from precompiled headers, and does better without them.
set(lamina_libraries lamina_stages lamina_stages_once_a_job lamina_once_a_job lamina_pipeline)
if(LAMINA_PRECOMPILE AND NOT CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache")
  # A library of nothing else: g++ 12 takes headers parsed at -O3 for sources at -O1, but not the other way round.
  if(NOT EXISTS ${PROJECT_BINARY_DIR}/precompiled.cpp)
    file(TOUCH ${PROJECT_BINARY_DIR}/precompiled.cpp)
  endif()
  add_library(lamina_precompiled OBJECT ${PROJECT_BINARY_DIR}/precompiled.cpp)
  target_link_libraries(lamina_precompiled PRIVATE TBB::tbb Eigen3::Eigen fmt::fmt)
  target_precompile_headers(lamina_precompiled PRIVATE cmake/precompiled.h)
  foreach(library ${lamina_libraries})
    target_precompile_headers(${library} REUSE_FROM lamina_precompiled)
    # g++ 12 forgets that precompiled headers are the system's, and has these wrong for std::string.
    target_compile_options(${library} PRIVATE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
  endforeach()
  list(APPEND lamina_libraries lamina_precompiled)
endif()

add_executable(lamina pipeline/main.cpp)
target_link_libraries(lamina PRIVATE lamina::pipeline)
lamina_libraries_first(lamina)

# Pictures need OpenImageIO, which brings some 260 shared libraries and a tenth of a second of start-up: a program of
# its own that `lamina preview` hands over to, so that no job pays for it.
lamina_sources(picture_sources "stages/view/picture/*.cpp")
add_executable(lamina-preview pipeline/preview_main.cpp pipeline/show/sheet.cpp ${picture_sources})
if(LAMINA_UNITY STREQUAL "all")
  list(FILTER picture_sources EXCLUDE REGEX "/(plan_view|swath_view)\\.cpp$")  # colours of their own
  lamina_unity(lamina-preview ${PROJECT_SOURCE_DIR}/pipeline/show/sheet.cpp ${picture_sources})
endif()
target_link_libraries(lamina-preview PRIVATE lamina::pipeline PkgConfig::OPENIMAGEIO nlohmann_json::nlohmann_json)

if(LAMINA_PRECOMPILE AND NOT CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache")
  target_precompile_headers(lamina-preview PRIVATE cmake/precompiled.h <OpenImageIO/imagebuf.h> <OpenImageIO/imagebufalgo.h>
                            <OpenImageIO/imageio.h>)
  target_compile_options(lamina-preview PRIVATE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
endif()

# Photographs need OpenCV: a program of its own too, that `lamina calibrate --scan` and `lamina compare` run as a filter. Debian's
# core and imgproc are enough; its files for CMake come with all of OpenCV, so that they are not required.
find_path(OPENCV_INCLUDE_DIR opencv2/imgproc.hpp PATH_SUFFIXES opencv4)
find_library(OPENCV_CORE_LIBRARY opencv_core)
find_library(OPENCV_IMGPROC_LIBRARY opencv_imgproc)
mark_as_advanced(OPENCV_INCLUDE_DIR OPENCV_CORE_LIBRARY OPENCV_IMGPROC_LIBRARY)
if(OPENCV_INCLUDE_DIR AND OPENCV_CORE_LIBRARY AND OPENCV_IMGPROC_LIBRARY)
  set(LAMINA_SCAN ON)
  lamina_sources(scan_sources "stages/calibration/scan/*.cpp")
  add_library(lamina_scan STATIC ${scan_sources} pipeline/calibrate/scan_answer.cpp)
  target_include_directories(lamina_scan SYSTEM PUBLIC ${OPENCV_INCLUDE_DIR})
  target_link_libraries(lamina_scan PUBLIC lamina::stages ${OPENCV_IMGPROC_LIBRARY} ${OPENCV_CORE_LIBRARY} nlohmann_json::nlohmann_json
                        PRIVATE PkgConfig::OPENIMAGEIO)
  target_compile_options(lamina_scan PRIVATE -Wno-array-bounds -Wno-stringop-overflow)
  add_executable(lamina-scan pipeline/scan_main.cpp)
  target_link_libraries(lamina-scan PRIVATE lamina_scan)
  if(LAMINA_UNITY STREQUAL "all")
    set_target_properties(lamina_scan PROPERTIES UNITY_BUILD OFF)  # helpers of one name in several files
  endif()
  if(LAMINA_TEST_SIDE STREQUAL "sanitized")
    set_target_properties(lamina_scan lamina-scan PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
else()
  set(LAMINA_SCAN OFF)
endif()

if(LAMINA_BENCH)
  find_package(benchmark REQUIRED)
  lamina_sources(bench_sources "bench/*.cpp")
  list(FILTER bench_sources EXCLUDE REGEX "/bench/peers/")  # programs on their own, of other libraries
  if(bench_sources)
    # Benchmarks check their answers against the same slow reference as the tests.
    add_executable(lamina_bench ${bench_sources} tests/raster/reference.cpp)
    target_link_libraries(lamina_bench PRIVATE lamina::pipeline benchmark::benchmark)
    set_target_properties(lamina_bench PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  endif()
endif()
