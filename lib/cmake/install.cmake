# cmake --install, and the Debian package libinvgrad-dev by `cpack -G DEB`.
#
#   include/invgrad/              the public headers, those of lib/invgrad itself,
#                                 and in internal/ what they include
#   lib/libinvgrad.a              and libinvgrad_torch.a, libinvgrad_mpi.a, if
#                                 they are built; .so with BUILD_SHARED_LIBS
#   lib/cmake/invgrad/            find_package(invgrad)
#   lib/pkgconfig/invgrad.pc
#   share/doc/libinvgrad-dev/     copyright
#
# The programs are not installed: names such as `compare` could conflict, and a
# program of the component compare is three lines. The installed tree is
# relocatable.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/invgrad)
set(pkgconfig_dir ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

install(TARGETS invgrad EXPORT invgradTargets
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
file(GLOB public_headers CONFIGURE_DEPENDS lib/invgrad/*.h)
file(GLOB internal_headers CONFIGURE_DEPENDS lib/invgrad/internal/*.h)
list(FILTER public_headers EXCLUDE REGEX "/(torch_network|mpi)\\.h$")
install(FILES ${public_headers}
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/invgrad)
install(FILES ${internal_headers}
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/invgrad/internal)
if(TARGET invgrad_torch)
  install(TARGETS invgrad_torch EXPORT invgradTorchTargets
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(FILES lib/invgrad/torch_network.h
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/invgrad)
  install(EXPORT invgradTorchTargets NAMESPACE invgrad::
    DESTINATION ${config_dir})
endif()

if(TARGET invgrad_mpi)
  install(TARGETS invgrad_mpi EXPORT invgradMpiTargets
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(FILES lib/invgrad/mpi.h
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/invgrad)
  install(EXPORT invgradMpiTargets NAMESPACE invgrad::
    DESTINATION ${config_dir})
endif()

if(TARGET invgrad_compare)
  install(TARGETS invgrad_compare EXPORT invgradCompareTargets
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  file(GLOB compare_headers CONFIGURE_DEPENDS lib/invgrad/compare/*.h)
  install(FILES ${compare_headers}
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/invgrad/compare)
  install(EXPORT invgradCompareTargets NAMESPACE invgrad::
    DESTINATION ${config_dir})
endif()

install(EXPORT invgradTargets NAMESPACE invgrad:: DESTINATION ${config_dir})
configure_package_config_file(lib/cmake/invgradConfig.cmake.in
  ${PROJECT_BINARY_DIR}/install/invgradConfig.cmake
  INSTALL_DESTINATION ${config_dir})
if(PROJECT_VERSION_MAJOR EQUAL 0)
  set(compatibility SameMinorVersion)
else()
  set(compatibility SameMajorVersion)
endif()
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/install/invgradConfigVersion.cmake
  COMPATIBILITY ${compatibility})
install(FILES
  lib/cmake/invgradLapack.cmake
  ${PROJECT_BINARY_DIR}/install/invgradConfig.cmake
  ${PROJECT_BINARY_DIR}/install/invgradConfigVersion.cmake
  DESTINATION ${config_dir})

file(RELATIVE_PATH to_prefix /${pkgconfig_dir} /)
string(REGEX REPLACE "/$" "" to_prefix ${to_prefix})
set(pkgconfig_blas "")  # "-lopenblas"
foreach(library ${invgrad_blas_libraries})
  get_filename_component(library ${library} NAME_WE)
  string(REGEX REPLACE "^(lib|-l)" "" library ${library})
  string(APPEND pkgconfig_blas " -l${library}")
endforeach()
configure_file(lib/cmake/invgrad.pc.in
  ${PROJECT_BINARY_DIR}/install/invgrad.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/install/invgrad.pc
  DESTINATION ${pkgconfig_dir})

# Debian's folder for the copyright.
install(FILES LICENSE
  DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/libinvgrad-dev
  RENAME copyright)

if(PROJECT_IS_TOP_LEVEL)
  set(CPACK_GENERATOR DEB)
  set(CPACK_PACKAGE_NAME libinvgrad-dev)
  set(CPACK_PACKAGE_VENDOR "the invgrad authors")
  set(CPACK_PACKAGE_CONTACT "the invgrad authors")
  set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR})
  set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
  set(CPACK_STRIP_FILES OFF)  # a static library keeps its symbols
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_SECTION libdevel)
  # For invgrad::torch, invgrad::mpi and invgrad::compare.
  set(CPACK_DEBIAN_PACKAGE_SUGGESTS
    "libtorch-dev, libopenmpi-dev, libgflags-dev, gnuplot-nox")
  set(CPACK_DEBIAN_PACKAGE_DEPENDS
    "libceres-dev (>= 2.1), libeigen3-dev (>= 3.4), libgoogle-glog-dev, libfmt-dev, libopenblas-dev, liblapacke-dev, libsuitesparse-dev, nlohmann-json3-dev")
  include(CPack)
endif()
