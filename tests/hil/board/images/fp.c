/* FP registers and flags in thread code, while interrupts use all of them. */
#include "chip.h"

volatile uint32_t wrong, wrong_flags, rounds, ticks;
static float pattern[33];

void systick(void)
{
    ticks++;
    __asm volatile("vmov.f32 s0, #31.0\n vmov.f32 s1, s0\n vmov.f32 s2, s0\n vmov.f32 s3, s0\n"
                   "vmov.f32 s4, s0\n vmov.f32 s5, s0\n vmov.f32 s6, s0\n vmov.f32 s7, s0\n"
                   "vmov.f32 s8, s0\n vmov.f32 s9, s0\n vmov.f32 s10, s0\n vmov.f32 s11, s0\n"
                   "vmov.f32 s12, s0\n vmov.f32 s13, s0\n vmov.f32 s14, s0\n vmov.f32 s15, s0\n"
                   "vcmp.f32 s0, #0\n vmrs apsr_nzcv, fpscr\n" ::
                       : "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12",
                         "s13", "s14", "s15", "cc");
}

static __attribute__((noinline)) void check(void)
{
    for (uint32_t i = 0; i < 33; i++) {
        pattern[i] = (float)(1000 + i);
    }
    SYST_RVR = 457;
    SYST_CVR = 0;
    SYST_CSR = 7;
    for (;;) {
        float out[32];
        uint32_t flags;
        /* -1 < 0 sets N in FPSCR; 31 in the handler does not. */
        __asm volatile("vldmia %1, {s0-s31}\n"
                       "vmov r4, s0\n vmov.f32 s0, #-1.0\n vcmp.f32 s0, #0\n vmov s0, r4\n"
                       "movs r5, #60\n"
                       "1: subs r5, #1\n bne 1b\n"
                       "vmrs %0, fpscr\n"
                       "vstmia %2, {s0-s31}\n"
                       : "=&r"(flags)
                       : "r"(pattern), "r"(out)
                       : "r4", "r5", "memory", "cc", "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8",
                         "s9", "s10", "s11", "s12", "s13", "s14", "s15", "s16", "s17", "s18", "s19", "s20",
                         "s21", "s22", "s23", "s24", "s25", "s26", "s27", "s28", "s29", "s30", "s31");
        for (uint32_t i = 0; i < 32; i++) {
            wrong += out[i] != pattern[i];
        }
        wrong_flags += flags >> 28 != 8;
        rounds++;
    }
}

int main(void)
{
    enable_fpu();
    check();
    return 0;
}
