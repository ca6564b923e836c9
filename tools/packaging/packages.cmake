# SPDX-License-Identifier: Apache-2.0
# Archives and packages, by CPack:
#   cpack -G TGZ --config CPackSourceConfig.cmake    the sources, with uPlot, so that they build offline
#   cpack                                            packages of Debian; needs dpkg-dev and file
# A package is a component of the installation: "stickslip", and "python", the Python module.
set(CPACK_PACKAGE_VENDOR "Stickslip")
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_CURRENT_LIST_DIR}/settings_of_cpack.cmake)

string(REGEX REPLACE "([][+.*()^$?|\\\\{}])" "\\\\\\1" root "${CMAKE_SOURCE_DIR}")
set(CPACK_SOURCE_GENERATOR TGZ)
set(CPACK_SOURCE_PACKAGE_FILE_NAME ${PROJECT_NAME}-${PROJECT_VERSION})
set(CPACK_SOURCE_IGNORE_FILES
  "^${root}/build(/|-)" "^${root}/\\.git(/|$)" /__pycache__/ "\\.pyc$" "/compile_commands\\.json$")

set(STICKSLIP_MAINTAINER "Stickslip <stickslip@localhost>" CACHE STRING
  "Whom users of a package write to: name <address>")
set(CPACK_STICKSLIP_DATE ${STICKSLIP_DATE})
set(CPACK_GENERATOR DEB)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
if(CMAKE_CROSSCOMPILING AND NOT CPACK_DEBIAN_PACKAGE_ARCHITECTURE)  # otherwise that of the compiling machine
  execute_process(COMMAND dpkg-architecture -t ${CMAKE_CXX_LIBRARY_ARCHITECTURE} -q DEB_HOST_ARCH
    OUTPUT_VARIABLE CPACK_DEBIAN_PACKAGE_ARCHITECTURE OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
set(CPACK_DEBIAN_PACKAGE_MAINTAINER ${STICKSLIP_MAINTAINER})
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL stickslip)
set(CPACK_DEBIAN_STICKSLIP_PACKAGE_NAME stickslip)
set(CPACK_DEBIAN_STICKSLIP_PACKAGE_SECTION science)
set(CPACK_DEBIAN_STICKSLIP_DESCRIPTION
"The daemon stickslipd acquires the channels of a bench at a fixed rate, drives its shaker
within limits, estimates the friction state, publishes over LCM and records. The tool
stickslip shows, checks, records, converts and diagnoses: it finds the physics that a model
lacks. As installed, the rig is a simulated one.")
set(CPACK_DEBIAN_STICKSLIP_PACKAGE_DEPENDS "iproute2, systemd (>= 252)")
set(CPACK_DEBIAN_STICKSLIP_PACKAGE_RECOMMENDS udev)
set(CPACK_DEBIAN_STICKSLIP_PACKAGE_SUGGESTS gnuplot-nox)
if(NOT STICKSLIP_PYTHON_PROBLEM)
  list(APPEND CPACK_COMPONENTS_ALL python)
  math(EXPR next_minor "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-stickslip)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION
"The Python module stickslip reads and writes recordings as NumPy arrays, simulates, scores
and diagnoses models of machines with dry friction, estimates their friction state, and
receives live frames over LCM.")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}), \
python3 (<< ${Python_VERSION_MAJOR}.${next_minor}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS stickslip)
endif()
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE zstd)

# Kept by an upgrade if they were edited, removed by a purge only.
set(conffiles /etc/stickslip/rig.toml /etc/stickslip/models/simulated.toml
  /etc/stickslip/models/simulated-truth.toml)
set(CPACK_STICKSLIP_CONFFILES ${conffiles})
list(JOIN conffiles "\n" conffiles)
set(control ${CMAKE_BINARY_DIR}/debian)
file(CONFIGURE OUTPUT ${control}/conffiles CONTENT "${conffiles}\n")
if(STICKSLIP_AVX2)
  set(STICKSLIP_PROCESSOR_FLAGS "abm avx2 bmi1 bmi2 f16c fma movbe")
endif()
configure_file(${CMAKE_CURRENT_LIST_DIR}/preinst.in ${control}/preinst @ONLY)
set(scripts ${CMAKE_CURRENT_LIST_DIR})
set(CPACK_DEBIAN_STICKSLIP_PACKAGE_CONTROL_EXTRA ${control}/conffiles ${control}/preinst
  ${scripts}/postinst ${scripts}/prerm ${scripts}/postrm)
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${control}/preinst ${scripts}/python/postinst
  ${scripts}/python/prerm)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
include(CPack)
