# Machine profiles become part of the program, so that an installed one finds them wherever it is.

# The profiles of a folder, as the rows that `function` of pipeline/machine/profiles.h gives.
function(lamina_ship_profiles folder function)
  file(GLOB profiles CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${folder}/*.toml)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${profiles})
  set(entries)
  foreach(profile ${profiles})
    get_filename_component(name ${profile} NAME_WE)
    file(READ ${profile} text)
    string(APPEND entries "    {\"${name}\", R\"profile(${text})profile\"},\n")
  endforeach()
  set(source ${PROJECT_BINARY_DIR}/${function}.cpp)
  file(CONFIGURE OUTPUT ${source} @ONLY CONTENT [[// Made from @folder@/ by cmake/profiles.cmake.
#include "pipeline/machine/profiles.h"

namespace lamina::pipeline {
namespace {

constexpr ShippedProfile kShipped[] = {
@entries@};

}  // namespace

std::span<const ShippedProfile> @function@() { return kShipped; }

}  // namespace lamina::pipeline
]])
  target_sources(lamina_pipeline PRIVATE ${source})
endfunction()

lamina_ship_profiles(pipeline/machine/shipped/printers shipped_machines)
lamina_ship_profiles(pipeline/machine/shipped/presets shipped_presets)
lamina_ship_profiles(pipeline/machine/shipped/extruders shipped_extruders)
lamina_ship_profiles(pipeline/machine/shipped/materials shipped_materials)
