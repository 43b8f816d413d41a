# How to compile for the STM32F405 and the STM32G474: the GNU Arm compiler, Cortex-M4 with its single-precision FPU.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR cortex-m4)

find_program(TRUING_ARM_GCC arm-none-eabi-gcc)
if(NOT TRUING_ARM_GCC)
  message(FATAL_ERROR "arm-none-eabi-gcc is not installed. On Debian: "
                      "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi")
endif()
set(CMAKE_C_COMPILER "${TRUING_ARM_GCC}")
set(CMAKE_ASM_COMPILER "${TRUING_ARM_GCC}")
find_program(CMAKE_OBJCOPY arm-none-eabi-objcopy REQUIRED)
find_program(CMAKE_SIZE arm-none-eabi-size REQUIRED)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)

# Paths inside the image are relative to the repository: its bytes do not depend on where that lies.
get_filename_component(TRUING_REPOSITORY "${CMAKE_CURRENT_LIST_DIR}/../.." ABSOLUTE)
set(TRUING_CPU_FLAGS
    "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 \"-ffile-prefix-map=${TRUING_REPOSITORY}=.\"")
set(CMAKE_C_FLAGS_INIT "${TRUING_CPU_FLAGS} -ffunction-sections -fdata-sections")
set(CMAKE_ASM_FLAGS_INIT "${TRUING_CPU_FLAGS}")

set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
