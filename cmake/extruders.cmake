# The profiles of extrusion printers become part of the program, as those of powder printers do (machines.cmake).
file(GLOB extruder_profiles CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/stages/write/machines/extrusion/*.toml)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${extruder_profiles})
set(extruder_entries)
foreach(profile ${extruder_profiles})
  get_filename_component(name ${profile} NAME_WE)
  file(READ ${profile} text)
  string(APPEND extruder_entries "    {\"${name}\", R\"profile(${text})profile\"},\n")
endforeach()
set(extruders_source ${PROJECT_BINARY_DIR}/shipped_extruders.cpp)
file(CONFIGURE OUTPUT ${extruders_source} @ONLY CONTENT [[// Made from stages/write/machines/extrusion/ by cmake/extruders.cmake.
#include "pipeline/extruder_profile.h"

namespace lamina::pipeline {
namespace {

constexpr ShippedExtruder kExtruders[] = {
@extruder_entries@};

}  // namespace

std::span<const ShippedExtruder> shipped_extruders() { return kExtruders; }

}  // namespace lamina::pipeline
]])

target_sources(lamina_pipeline PRIVATE ${extruders_source})
