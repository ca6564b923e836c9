# SPDX-License-Identifier: Apache-2.0
# Puts the archive of uPlot of this build where a build of the packed sources finds it.
list(GET CPACK_BUILD_SOURCE_DIRS 1 build)
file(GLOB uplot ${build}/npm/uplot-*.tgz)
if(NOT uplot)
  message(FATAL_ERROR "The archive of the sources has to carry uPlot, which ${build} does not have: "
    "configure it with -DSTICKSLIP_SCOPE=ON")
endif()
file(COPY ${uplot} DESTINATION ${CPACK_TEMPORARY_DIRECTORY}/tools/scope)
