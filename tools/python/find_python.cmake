# SPDX-License-Identifier: Apache-2.0
# STICKSLIP_PYTHON_PROBLEM: the reason, in one line, why the Python module is not built; otherwise empty.
set(STICKSLIP_PYTHON AUTO CACHE STRING "The Python module: AUTO (if Python and pybind11 are available), ON, OFF")
set_property(CACHE STICKSLIP_PYTHON PROPERTY STRINGS AUTO ON OFF)
set(STICKSLIP_PYTHON_PROBLEM "")
if(NOT STICKSLIP_PYTHON)
  set(STICKSLIP_PYTHON_PROBLEM "STICKSLIP_PYTHON is OFF")
elseif(STICKSLIP_SANITIZE)
  # The interpreter would have to be compiled with the sanitizer, too.
  set(STICKSLIP_PYTHON_PROBLEM "a sanitizer is compiled in")
else()
  # That of Debian, for which the package is made, before any other.
  if(NOT DEFINED Python_EXECUTABLE AND NOT DEFINED Python_ROOT_DIR)
    set(Python_ROOT_DIR /usr)
  endif()
  find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module NumPy)
  if(Python_FOUND)  # without it, pybind11 takes another one or ends the configuration
    find_package(pybind11 2.10 QUIET CONFIG)
  endif()
  foreach(needed Python_Interpreter:python3 Python_Development.Module:python3-dev Python_NumPy:python3-numpy
      pybind11:pybind11-dev)
    string(REPLACE ":" ";" needed ${needed})
    list(GET needed 0 part)
    if(NOT ${part}_FOUND AND NOT STICKSLIP_PYTHON_PROBLEM)
      list(GET needed 1 package)
      set(STICKSLIP_PYTHON_PROBLEM "${package} is not installed")
    endif()
  endforeach()
endif()
if(STICKSLIP_PYTHON_PROBLEM AND STICKSLIP_PYTHON AND NOT STICKSLIP_PYTHON STREQUAL "AUTO")
  message(FATAL_ERROR "STICKSLIP_PYTHON is ${STICKSLIP_PYTHON}, and ${STICKSLIP_PYTHON_PROBLEM}")
elseif(STICKSLIP_PYTHON_PROBLEM)
  message(STATUS "Without the Python module: ${STICKSLIP_PYTHON_PROBLEM}")
endif()
