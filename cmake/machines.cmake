# The machine profiles become part of the program, so that an installed one finds them wherever it is.
file(GLOB machine_profiles CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/stages/write/machines/*.toml)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${machine_profiles})
set(machine_entries)
foreach(profile ${machine_profiles})
  get_filename_component(name ${profile} NAME_WE)
  file(READ ${profile} text)
  string(APPEND machine_entries "    {\"${name}\", R\"profile(${text})profile\"},\n")
endforeach()
set(machines_source ${PROJECT_BINARY_DIR}/shipped_machines.cpp)
file(CONFIGURE OUTPUT ${machines_source} @ONLY CONTENT [[// Made from stages/write/machines/ by cmake/machines.cmake.
#include "pipeline/machine_profile.h"

namespace lamina::pipeline {
namespace {

constexpr ShippedMachine kMachines[] = {
@machine_entries@};

}  // namespace

std::span<const ShippedMachine> shipped_machines() { return kMachines; }

}  // namespace lamina::pipeline
]])

target_sources(lamina_pipeline PRIVATE ${machines_source})
