# Libraries, programs and benchmarks. Sources are found by folder: a file belongs to the stage it lies in.

function(lamina_sources result)
  set(found)
  foreach(pattern ${ARGN})
    file(GLOB_RECURSE files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${pattern})
    list(APPEND found ${files})
  endforeach()
  set(${result} ${found} PARENT_SCOPE)
endfunction()

include(GNUInstallDirs)

# --- stages: what is done
lamina_sources(stage_sources "stages/*.cpp")
list(FILTER stage_sources EXCLUDE REGEX "/stages/write/picture/")
add_library(lamina_stages STATIC ${stage_sources})
add_library(lamina::stages ALIAS lamina_stages)
target_include_directories(lamina_stages PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                                $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/lamina>)
target_link_libraries(lamina_stages PUBLIC TBB::tbb Eigen3::Eigen fmt::fmt embree
                      PRIVATE TIFF::TIFF PNG::PNG ZLIB::ZLIB PkgConfig::LIBZIP PkgConfig::LIB3MF
                              PkgConfig::POLYCLIPPING PkgConfig::MUPARSER PkgConfig::XXHASH)

# --- pipeline: how work moves
lamina_sources(pipeline_sources "pipeline/*.cpp")
list(FILTER pipeline_sources EXCLUDE REGEX "/pipeline/(main|preview_main|show/preview_layers|show/preview_swath)\\.cpp$")
add_library(lamina_pipeline STATIC ${pipeline_sources})
add_library(lamina::pipeline ALIAS lamina_pipeline)
# toml++ is used as headers: job_toml.cpp wants errors as values, and Debian's library was built with exceptions.
target_compile_definitions(lamina_pipeline PRIVATE LAMINA_VERSION="${PROJECT_VERSION}")
target_link_libraries(lamina_pipeline PUBLIC lamina::stages
                      PRIVATE nlohmann_json::nlohmann_json)

# What runs once a job is compiled to be compiled fast; what runs once a layer, and what decodes programs, is optimised.
if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
  foreach(folder batch calibrate cli job machine show text)
    lamina_sources(once_a_job "pipeline/${folder}/*.cpp")
    set_source_files_properties(${once_a_job} PROPERTIES COMPILE_OPTIONS -O1)
  endforeach()
endif()

# ccache keeps nothing that was made from precompiled headers, and does better without them.
if(LAMINA_PRECOMPILE AND NOT CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache")
  foreach(library lamina_stages lamina_pipeline)
    target_precompile_headers(${library} PRIVATE cmake/precompiled.h)
    # g++ 12 forgets that precompiled headers are the system's, and has these wrong for std::string.
    target_compile_options(${library} PRIVATE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
  endforeach()
endif()

add_executable(lamina pipeline/main.cpp)
target_link_libraries(lamina PRIVATE lamina::pipeline)

# Pictures need OpenImageIO, which brings some 260 shared libraries and a tenth of a second of start-up: a program of
# its own that `lamina preview` hands over to, so that no job pays for it.
lamina_sources(picture_sources "stages/write/picture/*.cpp")
add_executable(lamina-preview pipeline/preview_main.cpp pipeline/show/preview_layers.cpp pipeline/show/preview_swath.cpp
               ${picture_sources})
target_link_libraries(lamina-preview PRIVATE lamina::pipeline PkgConfig::OPENIMAGEIO nlohmann_json::nlohmann_json)

if(LAMINA_PRECOMPILE AND NOT CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache")
  target_precompile_headers(lamina-preview PRIVATE cmake/precompiled.h <OpenImageIO/imagebuf.h> <OpenImageIO/imagebufalgo.h>
                            <OpenImageIO/imageio.h>)
  target_compile_options(lamina-preview PRIVATE -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
endif()

if(NOT LAMINA_TEST_COMMANDS)
  set_target_properties(lamina-preview PROPERTIES EXCLUDE_FROM_ALL ON)
endif()

if(LAMINA_BENCH)
  find_package(benchmark REQUIRED)
  lamina_sources(bench_sources "bench/*.cpp")
  if(bench_sources)
    # Benchmarks check their answers against the same slow reference as the tests.
    add_executable(lamina_bench ${bench_sources} tests/raster/reference.cpp)
    target_link_libraries(lamina_bench PRIVATE lamina::pipeline benchmark::benchmark)
  endif()
endif()
