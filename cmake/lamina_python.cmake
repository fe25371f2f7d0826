# The Python module (python/): `import lamina` over the library, with arrays of numpy. Debian's python3-dev, pybind11-dev
# and python3-numpy. A module cannot be part of a sanitized build: Python itself is not sanitized.

# A module must be loadable at any address; hidden symbols keep calls within it direct. The libraries are compiled like this with and
# without the module, so that its packages can be installed later without compiling them again.
if(NOT LAMINA_SANITIZE)
  set_target_properties(${lamina_libraries} PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden)
endif()

set(Python_FIND_STRATEGY LOCATION)
if(NOT Python_EXECUTABLE AND EXISTS /usr/bin/python3)
  set(Python_EXECUTABLE /usr/bin/python3)  # the system's, whose numpy a package can require; not an earlier one in PATH
endif()
set(python_default OFF)
if(NOT LAMINA_SANITIZE)
  find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module)
  find_package(pybind11 2.10 QUIET)
  if(Python_FOUND AND pybind11_FOUND)
    set(python_default ON)
  endif()
endif()
if(NOT DEFINED LAMINA_PYTHON)
  set(LAMINA_PYTHON ${python_default})  # -DLAMINA_PYTHON=ON or OFF otherwise; not kept, as packages may be installed later
endif()
if(NOT LAMINA_PYTHON)
  return()
endif()
if(NOT Python_FOUND OR NOT pybind11_FOUND)
  message(FATAL_ERROR "LAMINA_PYTHON: install Debian's python3-dev and pybind11-dev, or configure with -DLAMINA_PYTHON=OFF")
endif()

pybind11_add_module(lamina_python MODULE NO_EXTRAS python/module.cpp python/arrays.cpp python/words.cpp)
if(LAMINA_UNITY STREQUAL "all")
  lamina_unity(lamina_python ${PROJECT_SOURCE_DIR}/python/module.cpp ${PROJECT_SOURCE_DIR}/python/arrays.cpp
               ${PROJECT_SOURCE_DIR}/python/words.cpp)
endif()
set_target_properties(lamina_python PROPERTIES OUTPUT_NAME lamina LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/python)
target_link_libraries(lamina_python PRIVATE lamina::pipeline)
# numpy is imported when arrays are made; its headers are not needed. Size over speed: what is called is optimised.
target_compile_options(lamina_python PRIVATE $<$<NOT:$<CONFIG:Debug>>:-Os> -Wno-conversion)
set(LAMINA_PYTHON_DIR lib/python3/dist-packages CACHE STRING "Where the Python module is installed, below the prefix")
install(TARGETS lamina_python LIBRARY DESTINATION ${LAMINA_PYTHON_DIR} COMPONENT python)
