# Machine profiles become part of the program, so that an installed one finds them wherever it is.

# The profiles of a folder, as the rows that `function` of `header` gives.
function(lamina_ship_profiles folder header type function)
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
#include "@header@"

namespace lamina::pipeline {
namespace {

constexpr @type@ kShipped[] = {
@entries@};

}  // namespace

std::span<const @type@> @function@() { return kShipped; }

}  // namespace lamina::pipeline
]])
  target_sources(lamina_pipeline PRIVATE ${source})
endfunction()

lamina_ship_profiles(stages/write/machines pipeline/machine/printer_profile.h ShippedMachine shipped_machines)
lamina_ship_profiles(stages/write/machines/extrusion pipeline/machine/extruder.h ShippedExtruder shipped_extruders)
