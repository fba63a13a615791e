	.file	"<string>"
	.section	.rodata.cst8,"aM",@progbits,8
	.p2align	3, 0x0
.LCPI0_0:
	.quad	0xbff0000000000000
.LCPI0_1:
	.quad	0x3ff0000000000000
.LCPI0_2:
	.quad	0xbe112e0be826d695
.LCPI0_3:
	.quad	0x3e112e0be826d695
.LCPI0_5:
	.quad	0x7e37e43c8800759c
.LCPI0_6:
	.quad	4
.LCPI0_7:
	.quad	8
.LCPI0_8:
	.quad	12
.LCPI0_10:
	.quad	16
	.section	.rodata.cst32,"aM",@progbits,32
	.p2align	5, 0x0
.LCPI0_4:
	.quad	0
	.quad	1
	.quad	2
	.quad	3
.LCPI0_9:
	.long	8
	.long	0
	.long	10
	.long	1
	.long	12
	.long	2
	.long	14
	.long	3
	.section	.ltext,"axl",@progbits
	.globl	_ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE
	.p2align	4
	.type	_ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE,@function
_ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE:
	pushq	%rbp
	pushq	%r15
	pushq	%r14
	pushq	%r13
	pushq	%r12
	pushq	%rbx
	subq	$72, %rsp
	movq	%rdi, -32(%rsp)
	movq	208(%rsp), %r15
	movq	216(%rsp), %r12
	subq	%r15, %r12
	testq	%r12, %r12
	jle	.LBB0_1
	movq	616(%rsp), %r11
	movq	560(%rsp), %r14
	movq	504(%rsp), %rdx
	movq	448(%rsp), %r10
	movq	264(%rsp), %rax
	movq	256(%rsp), %r9
	movq	%rax, %rsi
	movq	%rax, %rbp
	sarq	%rsi
	leaq	64(%r14), %r8
	leaq	64(%r11), %r13
	movq	%r13, -104(%rsp)
	leaq	128(%rdx), %rcx
	movq	%rdx, %rax
	leaq	128(%r10), %rdx
	leaq	128(%r9), %rbx
	movq	%rbx, -72(%rsp)
	cmpq	%r13, %r14
	setb	%dil
	cmpq	%r8, %r11
	setb	%r9b
	andb	%dil, %r9b
	cmpq	%rcx, %r14
	movq	%rcx, %r13
	setb	%dil
	cmpq	%r8, %rax
	setb	%r11b
	andb	%dil, %r11b
	orb	%r9b, %r11b
	cmpq	%rdx, %r14
	movq	%rdx, %rcx
	setb	%dil
	cmpq	%r8, %r10
	setb	%r9b
	andb	%dil, %r9b
	cmpq	%rbx, %r14
	setb	%dil
	movq	256(%rsp), %rax
	cmpq	%r8, %rax
	setb	%bl
	leaq	(%rsi,%rbp), %r10
	andb	%dil, %bl
	orb	%r9b, %bl
	leaq	(%rax,%r10,8), %rdx
	movq	%rdx, -80(%rsp)
	leaq	128(%rax,%r10,8), %r10
	orb	%r11b, %bl
	cmpq	%r10, %r14
	setb	%r9b
	cmpq	%r8, %rdx
	setb	%bpl
	andb	%r9b, %bpl
	movq	%rsi, -48(%rsp)
	leaq	128(%rax,%rsi,8), %rdi
	movq	%rdi, -120(%rsp)
	cmpq	%rdi, %r14
	setb	%r14b
	leaq	(%rax,%rsi,8), %rdx
	cmpq	%r8, %rdx
	setb	%r11b
	andb	%r14b, %r11b
	movq	616(%rsp), %r14
	orb	%bpl, %r11b
	orb	%bl, %r11b
	cmpq	%r13, %r14
	setb	%r8b
	movq	504(%rsp), %r9
	movq	-104(%rsp), %rsi
	cmpq	%rsi, %r9
	setb	%bl
	andb	%r8b, %bl
	cmpq	%rcx, %r14
	movq	%rcx, %rdi
	movq	%rcx, -112(%rsp)
	setb	%r8b
	movq	448(%rsp), %rcx
	cmpq	%rsi, %rcx
	setb	%bpl
	andb	%r8b, %bpl
	orb	%bl, %bpl
	movq	-72(%rsp), %rax
	cmpq	%rax, %r14
	setb	%r8b
	cmpq	%rsi, 256(%rsp)
	setb	%bl
	andb	%r8b, %bl
	orb	%bpl, %bl
	cmpq	%r10, %r14
	setb	%bpl
	movq	-80(%rsp), %rcx
	cmpq	%rsi, %rcx
	setb	%r8b
	andb	%bpl, %r8b
	movq	%rdx, %rbp
	orb	%bl, %r8b
	orb	%r11b, %r8b
	movq	-120(%rsp), %rdx
	cmpq	%rdx, %r14
	setb	%r11b
	cmpq	%rsi, %rbp
	setb	%sil
	andb	%r11b, %sil
	cmpq	%rdi, %r9
	setb	%r11b
	cmpq	%r13, 448(%rsp)
	setb	%bl
	andb	%r11b, %bl
	orb	%sil, %bl
	cmpq	%rax, %r9
	setb	%sil
	cmpq	%r13, 256(%rsp)
	setb	%r11b
	andb	%sil, %r11b
	orb	%bl, %r11b
	cmpq	%r10, %r9
	setb	%sil
	cmpq	%r13, %rcx
	movq	%rcx, %rdi
	setb	%bl
	andb	%sil, %bl
	orb	%r11b, %bl
	cmpq	%rdx, %r9
	setb	%sil
	cmpq	%r13, %rbp
	movq	312(%rsp), %rdx
	vmovsd	(%rdx), %xmm2
	vmovsd	8(%rdx), %xmm3
	vmovsd	16(%rdx), %xmm4
	vmovsd	24(%rdx), %xmm22
	setb	%r11b
	vmovsd	32(%rdx), %xmm25
	andb	%sil, %r11b
	orb	%bl, %r11b
	movq	256(%rsp), %rbx
	movq	448(%rsp), %r9
	cmpq	%rax, %r9
	setb	%cl
	movq	-112(%rsp), %r13
	cmpq	%r13, %rbx
	setb	%sil
	andb	%cl, %sil
	orb	%r8b, %sil
	movq	%r9, %r8
	movq	344(%rsp), %rdx
	cmpq	%r10, %r9
	movq	-48(%rsp), %r10
	setb	%al
	cmpq	%r13, %rdi
	movq	336(%rsp), %rcx
	vcvtsi2sd	%rcx, %xmm15, %xmm0
	setb	%dil
	andb	%al, %dil
	orb	%r11b, %dil
	movabsq	$.LCPI0_0, %rax
	vaddsd	(%rax), %xmm0, %xmm5
	cmpq	-120(%rsp), %r9
	movq	264(%rsp), %r9
	setb	%r11b
	movq	352(%rsp), %rax
	leaq	-1(%rdx,%rax), %rax
	movq	%rax, -56(%rsp)
	cmpq	%r13, %rbp
	movq	560(%rsp), %rax
	setb	%dl
	andb	%r11b, %dl
	orb	%sil, %dl
	orb	%dil, %dl
	movb	%dl, -121(%rsp)
	vpbroadcastq	%r10, %ymm6
	vpbroadcastq	%r9, %ymm7
	vbroadcastsd	%xmm5, %ymm8
	movq	344(%rsp), %r13
	negq	%r13
	movq	%r13, -24(%rsp)
	shlq	$3, %rcx
	movq	%rcx, -104(%rsp)
	movabsq	$.LCPI0_2, %rcx
	vmovsd	(%rcx), %xmm9
	movabsq	$.LCPI0_3, %rcx
	vmovsd	(%rcx), %xmm10
	vxorpd	%xmm11, %xmm11, %xmm11
	vxorpd	%xmm12, %xmm12, %xmm12
	movq	392(%rsp), %rcx
	movq	128(%rsp), %rdi
	addq	$96, %rcx
	movq	%rcx, -72(%rsp)
	movabsq	$.LCPI0_9, %rcx
	movabsq	$.LCPI0_6, %r11
	movq	$0, -88(%rsp)
	movq	$0, -96(%rsp)
	movq	%rbp, 40(%rsp)
	vmovsd	%xmm2, 16(%rsp)
	vmovsd	%xmm3, 8(%rsp)
	vmovsd	%xmm4, (%rsp)
	vmovsd	%xmm22, -8(%rsp)
	vmovsd	%xmm25, -16(%rsp)
	jmp	.LBB0_12
	.p2align	4
.LBB0_3:
	movq	-64(%rsp), %rdx
	addq	%rdx, -96(%rsp)
	vmovsd	16(%rsp), %xmm2
	vmovsd	8(%rsp), %xmm3
	vmovsd	(%rsp), %xmm4
	vmovsd	-8(%rsp), %xmm22
	vmovsd	-16(%rsp), %xmm25
.LBB0_4:
	movq	128(%rsp), %rdi
	movq	32(%rsp), %r15
	incq	%r15
	movq	24(%rsp), %rdx
	cmpq	$1, %rdx
	leaq	-1(%rdx), %r12
	jle	.LBB0_2
.LBB0_12:
	movq	%r12, 24(%rsp)
	movq	%r15, %rdx
	sarq	$63, %rdx
	andq	192(%rsp), %rdx
	movq	%r15, 32(%rsp)
	movq	184(%rsp), %rsi
	leaq	(%rsi,%r15,4), %rsi
	movslq	(%rsi,%rdx,4), %r13
	leaq	(%r13,%r13,8), %rdx
	vmovss	(%rdi,%rdx,4), %xmm0
	vcvtss2sd	%xmm0, %xmm0, %xmm0
	vmovss	4(%rdi,%rdx,4), %xmm1
	vcvtss2sd	%xmm1, %xmm1, %xmm24
	vmovss	8(%rdi,%rdx,4), %xmm1
	vcvtss2sd	%xmm1, %xmm1, %xmm1
	vmulsd	%xmm0, %xmm25, %xmm13
	vsubsd	%xmm22, %xmm1, %xmm14
	vmovss	12(%rdi,%rdx,4), %xmm0
	vcvtss2sd	%xmm0, %xmm0, %xmm0
	vmulsd	%xmm0, %xmm25, %xmm1
	vmovss	16(%rdi,%rdx,4), %xmm0
	vcvtss2sd	%xmm0, %xmm0, %xmm0
	vmovss	20(%rdi,%rdx,4), %xmm15
	vcvtss2sd	%xmm15, %xmm15, %xmm15
	vsubsd	%xmm22, %xmm15, %xmm17
	vfnmadd231sd	%xmm14, %xmm3, %xmm24
	vfmsub213sd	%xmm2, %xmm4, %xmm24
	vfnmadd231sd	%xmm17, %xmm3, %xmm0
	vfmsub213sd	%xmm2, %xmm4, %xmm0
	vucomisd	%xmm0, %xmm24
	jbe	.LBB0_13
	vmovapd	%xmm17, %xmm15
	vmovapd	%xmm1, %xmm16
	vmovapd	%xmm0, %xmm17
	jmp	.LBB0_6
	.p2align	4
.LBB0_13:
	vmovapd	%xmm14, %xmm15
	vmovapd	%xmm13, %xmm16
	vmovapd	%xmm17, %xmm14
	vmovapd	%xmm1, %xmm13
	vmovapd	%xmm24, %xmm17
	vmovapd	%xmm0, %xmm24
.LBB0_6:
	movabsq	$.LCPI0_0, %r15
	movabsq	$.LCPI0_2, %rsi
	movabsq	$.LCPI0_3, %r12
	vmovss	24(%rdi,%rdx,4), %xmm0
	vcvtss2sd	%xmm0, %xmm0, %xmm0
	vmulsd	%xmm0, %xmm25, %xmm18
	vmovss	28(%rdi,%rdx,4), %xmm0
	vcvtss2sd	%xmm0, %xmm0, %xmm19
	vmovss	32(%rdi,%rdx,4), %xmm0
	vcvtss2sd	%xmm0, %xmm0, %xmm0
	vsubsd	%xmm22, %xmm0, %xmm20
	vfnmadd231sd	%xmm20, %xmm3, %xmm19
	vfmsub213sd	%xmm2, %xmm4, %xmm19
	vucomisd	%xmm19, %xmm24
	jbe	.LBB0_7
	vmovapd	%xmm20, %xmm0
	vmovapd	%xmm19, %xmm1
	vmovapd	%xmm18, %xmm21
	vucomisd	%xmm1, %xmm17
	ja	.LBB0_14
.LBB0_10:
	vmovapd	%xmm15, %xmm18
	vmovapd	%xmm17, %xmm19
	vmovapd	%xmm16, %xmm20
	vmovapd	%xmm0, %xmm15
	vmovapd	%xmm1, %xmm17
	vmovapd	%xmm21, %xmm16
	jmp	.LBB0_15
	.p2align	4
.LBB0_7:
	vmovapd	%xmm14, %xmm0
	vmovapd	%xmm24, %xmm1
	vmovapd	%xmm13, %xmm21
	vmovapd	%xmm20, %xmm14
	vmovapd	%xmm19, %xmm24
	vmovapd	%xmm18, %xmm13
	vucomisd	%xmm1, %xmm17
	jbe	.LBB0_10
.LBB0_14:
	vmovapd	%xmm0, %xmm18
	vmovapd	%xmm1, %xmm19
	vmovapd	%xmm21, %xmm20
.LBB0_15:
	vucomisd	%xmm19, %xmm24
	vxorpd	%xmm0, %xmm0, %xmm0
	vmovapd	%xmm0, 48(%rsp)
	vmovsd	%xmm0, -40(%rsp)
	ja	.LBB0_16
	vucomisd	%xmm19, %xmm17
	ja	.LBB0_18
.LBB0_19:
	vucomisd	%xmm17, %xmm24
	vxorpd	%xmm23, %xmm23, %xmm23
	jbe	.LBB0_21
.LBB0_20:
	vsubsd	%xmm17, %xmm24, %xmm0
	movabsq	$.LCPI0_1, %rdx
	vmovsd	(%rdx), %xmm1
	vdivsd	%xmm0, %xmm1, %xmm23
.LBB0_21:
	vaddsd	%xmm9, %xmm19, %xmm0
	vroundsd	$10, %xmm0, %xmm0, %xmm0
	vcvttsd2si	%xmm0, %rdi
	movq	344(%rsp), %rdx
	cmpq	%rdi, %rdx
	movq	%rdi, %rdx
	vaddsd	%xmm10, %xmm24, %xmm0
	vroundsd	$9, %xmm0, %xmm0, %xmm0
	vcvttsd2si	%xmm0, %rdi
	cmovgq	344(%rsp), %rdx
	cmpq	%rdi, -56(%rsp)
	cmovlq	-56(%rsp), %rdi
	movq	%rdx, -112(%rsp)
	subq	%rdx, %rdi
	incq	%rdi
	testq	%rdi, %rdi
	movl	$0, %edx
	cmovleq	%rdx, %rdi
	jle	.LBB0_4
	vpbroadcastq	%r13, %ymm24
	movq	%rdi, -64(%rsp)
	movq	-24(%rsp), %rdx
	movq	-112(%rsp), %rdi
	addq	%rdi, %rdx
	imulq	%r10, %rdx
	movq	%rdx, -120(%rsp)
	movq	-64(%rsp), %rdx
	jmp	.LBB0_23
	.p2align	4
.LBB0_51:
	movq	-112(%rsp), %rdi
	incq	%rdi
	addq	%rbp, -88(%rsp)
	movq	-48(%rsp), %r10
	addq	%r10, -120(%rsp)
	movq	-80(%rsp), %rdx
	cmpq	$1, %rdx
	leaq	-1(%rdx), %rdx
	movq	448(%rsp), %r8
	movq	264(%rsp), %r9
	movq	256(%rsp), %rbx
	movq	40(%rsp), %rbp
	movabsq	$.LCPI0_0, %r15
	movabsq	$.LCPI0_2, %rsi
	movabsq	$.LCPI0_3, %r12
	jle	.LBB0_3
.LBB0_23:
	movq	%rdx, -80(%rsp)
	movq	%rdi, -112(%rsp)
	vcvtsi2sd	%rdi, %xmm5, %xmm0
	vsubsd	%xmm19, %xmm0, %xmm1
	vmulsd	-40(%rsp), %xmm1, %xmm1
	vmaxsd	%xmm1, %xmm11, %xmm1
	movabsq	$.LCPI0_1, %rdx
	vmovsd	(%rdx), %xmm27
	vminsd	%xmm1, %xmm27, %xmm1
	vsubsd	%xmm1, %xmm27, %xmm26
	vmulsd	%xmm26, %xmm20, %xmm25
	vfmadd231sd	%xmm1, %xmm13, %xmm25
	vmulsd	%xmm26, %xmm18, %xmm26
	vucomisd	%xmm0, %xmm17
	seta	%dl
	vfmadd231sd	%xmm1, %xmm14, %xmm26
	kmovd	%edx, %k1
	vmovapd	%xmm16, %xmm1
	vmovsd	%xmm20, %xmm1, %xmm1 {%k1}
	vmovapd	%xmm15, %xmm28
	vmovsd	%xmm18, %xmm28, %xmm28 {%k1}
	vmovapd	%xmm13, %xmm29
	vmovsd	%xmm16, %xmm29, %xmm29 {%k1}
	vmovapd	%xmm14, %xmm30
	vmovsd	%xmm15, %xmm30, %xmm30 {%k1}
	vmovapd	%xmm17, %xmm31
	vmovsd	%xmm19, %xmm31, %xmm31 {%k1}
	vsubsd	%xmm31, %xmm0, %xmm0
	vmovapd	%xmm23, %xmm31
	vmovapd	48(%rsp), %xmm2
	vmovsd	%xmm2, %xmm31, %xmm31 {%k1}
	vmulsd	%xmm0, %xmm31, %xmm0
	vmaxsd	%xmm0, %xmm11, %xmm0
	vminsd	%xmm0, %xmm27, %xmm31
	vsubsd	%xmm31, %xmm27, %xmm27
	vmulsd	%xmm27, %xmm1, %xmm0
	vfmadd231sd	%xmm29, %xmm31, %xmm0
	vmulsd	%xmm27, %xmm28, %xmm27
	vfmadd231sd	%xmm30, %xmm31, %xmm27
	vsubsd	%xmm26, %xmm27, %xmm1
	testb	$1, -121(%rsp)
	movq	504(%rsp), %rdi
	je	.LBB0_26
	xorl	%edx, %edx
	movabsq	$.LCPI0_5, %r12
	.p2align	4
.LBB0_25:
	leaq	(%r10,%rdx), %rsi
	sarq	$63, %rsi
	andq	%r9, %rsi
	leaq	(%rbp,%rsi,8), %rsi
	vmovsd	(%rsi,%rdx,8), %xmm2
	vmovapd	%xmm2, %xmm3
	vfnmadd213sd	%xmm25, %xmm26, %xmm3
	vmovsd	(%rbx,%rdx,8), %xmm4
	vsubsd	%xmm4, %xmm3, %xmm3
	vfnmadd213sd	%xmm0, %xmm27, %xmm2
	vsubsd	%xmm4, %xmm2, %xmm2
	vminsd	%xmm3, %xmm2, %xmm4
	vaddsd	%xmm4, %xmm9, %xmm4
	vmaxsd	%xmm4, %xmm11, %xmm4
	vroundsd	$10, %xmm4, %xmm4, %xmm4
	vcvttsd2si	%xmm4, %rsi
	movl	%esi, (%rax,%rdx,4)
	vmaxsd	%xmm3, %xmm2, %xmm4
	vaddsd	%xmm4, %xmm10, %xmm4
	vminsd	%xmm4, %xmm5, %xmm4
	vmovsd	(%r15), %xmm28
	vmaxsd	%xmm4, %xmm28, %xmm4
	vroundsd	$9, %xmm4, %xmm4, %xmm4
	vcvttsd2si	%xmm4, %rsi
	movl	%esi, (%r14,%rdx,4)
	vsubsd	%xmm3, %xmm2, %xmm2
	vcmpneqsd	%xmm11, %xmm2, %k1
	vmovsd	(%r12), %xmm4
	vmovsd	%xmm2, %xmm4, %xmm4 {%k1}
	vdivsd	%xmm4, %xmm1, %xmm2
	vmovsd	%xmm2, (%rdi,%rdx,8)
	vfnmadd213sd	%xmm26, %xmm3, %xmm2
	vmovsd	%xmm2, (%r8,%rdx,8)
	incq	%rdx
	cmpq	$16, %rdx
	jne	.LBB0_25
	jmp	.LBB0_28
	.p2align	4
.LBB0_26:
	vbroadcastsd	%xmm25, %ymm25
	vbroadcastsd	%xmm26, %ymm28
	vbroadcastsd	%xmm0, %ymm0
	vbroadcastsd	%xmm27, %ymm29
	movabsq	$.LCPI0_4, %rdx
	vmovdqa64	(%rdx), %ymm30
	vbroadcastsd	%xmm1, %ymm1
	xorl	%edx, %edx
	movabsq	$.LCPI0_5, %r9
	.p2align	4
.LBB0_27:
	vpaddq	%ymm6, %ymm30, %ymm31
	vpsraq	$63, %ymm31, %ymm2
	vpand	%ymm7, %ymm2, %ymm2
	vpsllq	$3, %ymm31, %ymm31
	vpbroadcastq	%rbx, %ymm3
	vpsllq	$3, %ymm2, %ymm2
	vpaddq	%ymm2, %ymm31, %ymm2
	vpaddq	%ymm2, %ymm3, %ymm2
	vpxor	%xmm3, %xmm3, %xmm3
	kxnorw	%k0, %k0, %k1
	vgatherqpd	(,%ymm2), %ymm3 {%k1}
	vmovapd	%ymm3, %ymm2
	vfnmadd213pd	%ymm25, %ymm28, %ymm2
	vmovupd	(%rbx,%rdx,2), %ymm31
	vsubpd	%ymm31, %ymm2, %ymm2
	vfnmadd213pd	%ymm0, %ymm29, %ymm3
	vsubpd	%ymm31, %ymm3, %ymm3
	vminpd	%ymm2, %ymm3, %ymm31
	vaddpd	(%rsi){1to4}, %ymm31, %ymm31
	vmaxpd	%ymm31, %ymm12, %ymm31
	vrndscalepd	$10, %ymm31, %ymm31
	vcvttpd2qq	%ymm31, %ymm31
	vpmovqd	%ymm31, (%rax,%rdx)
	vmaxpd	%ymm2, %ymm3, %ymm31
	vaddpd	(%r12){1to4}, %ymm31, %ymm31
	vminpd	%ymm31, %ymm8, %ymm31
	vbroadcastsd	(%r15), %ymm4
	vmaxpd	%ymm31, %ymm4, %ymm4
	vroundpd	$9, %ymm4, %ymm4
	vcvttpd2qq	%ymm4, %ymm4
	vpmovqd	%ymm4, (%r14,%rdx)
	vsubpd	%ymm2, %ymm3, %ymm3
	vcmpneqpd	%ymm12, %ymm3, %k1
	vbroadcastsd	(%r9), %ymm4
	vmovapd	%ymm3, %ymm4 {%k1}
	vdivpd	%ymm4, %ymm1, %ymm3
	vmovupd	%ymm3, (%rdi,%rdx,2)
	vfnmadd213pd	%ymm28, %ymm2, %ymm3
	vmovupd	%ymm3, (%r8,%rdx,2)
	vpaddq	(%r11){1to4}, %ymm30, %ymm30
	addq	$16, %rdx
	cmpq	$64, %rdx
	jne	.LBB0_27
.LBB0_28:
	xorl	%ebp, %ebp
	xorl	%edx, %edx
	movq	672(%rsp), %r8
	.p2align	4
.LBB0_29:
	movq	%rbp, %rsi
	movl	%edx, (%r8,%rbp,4)
	movl	(%rax,%rdx,4), %edi
	xorl	%ebp, %ebp
	cmpl	(%r14,%rdx,4), %edi
	leaq	1(%rdx), %rdx
	setle	%bpl
	addq	%rsi, %rbp
	cmpq	$16, %rdx
	jne	.LBB0_29
	vmaxsd	%xmm26, %xmm27, %xmm25
	vucomisd	%xmm25, %xmm11
	ja	.LBB0_51
	testq	%rbp, %rbp
	je	.LBB0_51
	vminsd	%xmm26, %xmm27, %xmm0
	vmaxsd	%xmm0, %xmm11, %xmm26
	vbroadcastsd	%xmm26, %ymm27
	vbroadcastsd	%xmm25, %ymm28
	movq	%rbp, %r12
	xorl	%r9d, %r9d
	jmp	.LBB0_33
	.p2align	4
.LBB0_50:
	incq	%r9
	cmpq	$1, %r12
	leaq	-1(%r12), %r12
	movq	616(%rsp), %r14
	movq	560(%rsp), %rax
	jle	.LBB0_51
.LBB0_33:
	movq	672(%rsp), %rdx
	movslq	(%rdx,%r9,4), %r10
	movslq	(%rax,%r10,4), %rsi
	movslq	(%r14,%r10,4), %rdx
	subq	%rsi, %rdx
	js	.LBB0_50
	movq	448(%rsp), %rdi
	vmovsd	(%rdi,%r10,8), %xmm29
	movq	504(%rsp), %rdi
	vmovsd	(%rdi,%r10,8), %xmm30
	leaq	1(%rdx), %r8
	cmpq	$3, %rdx
	jae	.LBB0_36
	movq	%r8, %rdx
	movq	%rsi, %r14
	jmp	.LBB0_46
	.p2align	4
.LBB0_36:
	cmpq	$15, %rdx
	jae	.LBB0_38
	xorl	%ebx, %ebx
	movq	%rsi, %rax
	jmp	.LBB0_43
.LBB0_38:
	movq	%r8, %rbx
	movabsq	$9223372036854775792, %rdx
	andq	%rdx, %rbx
	vbroadcastsd	%xmm30, %ymm31
	vpbroadcastq	%rsi, %ymm0
	movabsq	$.LCPI0_4, %rdx
	vpaddq	(%rdx), %ymm0, %ymm0
	vbroadcastsd	%xmm29, %ymm1
	movq	-120(%rsp), %rax
	leaq	(%rax,%r10), %rdx
	imulq	-104(%rsp), %rdx
	leaq	(%rdx,%rsi,8), %rdx
	addq	-72(%rsp), %rdx
	xorl	%r14d, %r14d
	movabsq	$.LCPI0_7, %rdi
	movabsq	$.LCPI0_8, %r15
	movabsq	$.LCPI0_10, %rax
	.p2align	4
.LBB0_39:
	vpaddq	(%r11){1to4}, %ymm0, %ymm2
	vpaddq	(%rdi){1to4}, %ymm0, %ymm3
	vpaddq	(%r15){1to4}, %ymm0, %ymm4
	vcvtqq2pd	%ymm0, %ymm21
	vcvtqq2pd	%ymm2, %ymm2
	vcvtqq2pd	%ymm3, %ymm3
	vcvtqq2pd	%ymm4, %ymm4
	vfmadd213pd	%ymm1, %ymm31, %ymm21
	vfmadd213pd	%ymm1, %ymm31, %ymm2
	vfmadd213pd	%ymm1, %ymm31, %ymm3
	vfmadd213pd	%ymm1, %ymm31, %ymm4
	vmaxpd	%ymm21, %ymm27, %ymm21
	vmaxpd	%ymm2, %ymm27, %ymm2
	vmaxpd	%ymm3, %ymm27, %ymm3
	vmaxpd	%ymm4, %ymm27, %ymm4
	vminpd	%ymm21, %ymm28, %ymm21
	vminpd	%ymm2, %ymm28, %ymm2
	vminpd	%ymm3, %ymm28, %ymm3
	vminpd	%ymm4, %ymm28, %ymm4
	vcvtpd2ps	%ymm21, %xmm21
	vcvtpd2ps	%ymm2, %xmm2
	vcvtpd2ps	%ymm3, %xmm3
	vcvtpd2ps	%ymm4, %xmm4
	vmovdqa64	(%rcx), %ymm22
	vpermt2d	%ymm12, %ymm22, %ymm21
	vpermt2d	%ymm12, %ymm22, %ymm2
	vpermt2d	%ymm12, %ymm22, %ymm3
	vpermt2d	%ymm12, %ymm22, %ymm4
	vporq	%ymm24, %ymm21, %ymm21
	vporq	%ymm24, %ymm2, %ymm2
	vporq	%ymm24, %ymm3, %ymm3
	vporq	%ymm24, %ymm4, %ymm4
	vpminsq	-96(%rdx,%r14,8), %ymm21, %ymm21
	vpminsq	-64(%rdx,%r14,8), %ymm2, %ymm2
	vpminsq	-32(%rdx,%r14,8), %ymm3, %ymm3
	vpminsq	(%rdx,%r14,8), %ymm4, %ymm4
	vmovdqu64	%ymm21, -96(%rdx,%r14,8)
	vmovdqu	%ymm2, -64(%rdx,%r14,8)
	vmovdqu	%ymm3, -32(%rdx,%r14,8)
	vmovdqu	%ymm4, (%rdx,%r14,8)
	addq	$16, %r14
	vpaddq	(%rax){1to4}, %ymm0, %ymm0
	cmpq	%r14, %rbx
	jne	.LBB0_39
	cmpq	%rbx, %r8
	je	.LBB0_50
	testb	$12, %r8b
	je	.LBB0_52
	leaq	(%rbx,%rsi), %rax
.LBB0_43:
	movabsq	$9223372036854775792, %rdx
	leaq	12(%rdx), %rdi
	andq	%r8, %rdi
	movl	%r8d, %edx
	andl	$3, %edx
	leaq	(%rdi,%rsi), %r14
	vbroadcastsd	%xmm30, %ymm0
	vbroadcastsd	%xmm29, %ymm1
	vpbroadcastq	%rax, %ymm2
	movabsq	$.LCPI0_4, %r15
	vpaddq	(%r15), %ymm2, %ymm31
	movq	-120(%rsp), %rax
	leaq	(%rax,%r10), %r15
	imulq	-104(%rsp), %r15
	leaq	(%r15,%rsi,8), %rsi
	addq	392(%rsp), %rsi
	.p2align	4
.LBB0_44:
	vcvtqq2pd	%ymm31, %ymm2
	vfmadd213pd	%ymm1, %ymm0, %ymm2
	vmaxpd	%ymm2, %ymm27, %ymm2
	vminpd	%ymm2, %ymm28, %ymm2
	vcvtpd2ps	%ymm2, %xmm2
	vmovdqa	(%rcx), %ymm3
	vpermi2d	%ymm12, %ymm2, %ymm3
	vporq	%ymm24, %ymm3, %ymm2
	vpminsq	(%rsi,%rbx,8), %ymm2, %ymm2
	vmovdqu	%ymm2, (%rsi,%rbx,8)
	addq	$4, %rbx
	vpaddq	(%r11){1to4}, %ymm31, %ymm31
	cmpq	%rbx, %rdi
	jne	.LBB0_44
	cmpq	%rdi, %r8
	je	.LBB0_50
.LBB0_46:
	incq	%rdx
	addq	-120(%rsp), %r10
	imulq	-104(%rsp), %r10
	addq	392(%rsp), %r10
	jmp	.LBB0_47
	.p2align	4
.LBB0_49:
	movq	%rdi, (%r10,%r14,8)
	incq	%r14
	decq	%rdx
	cmpq	$1, %rdx
	jbe	.LBB0_50
.LBB0_47:
	vcvtsi2sd	%r14, %xmm15, %xmm0
	vfmadd213sd	%xmm29, %xmm30, %xmm0
	vmaxsd	%xmm0, %xmm26, %xmm0
	vminsd	%xmm0, %xmm25, %xmm0
	vcvtsd2ss	%xmm0, %xmm0, %xmm0
	vmovd	%xmm0, %esi
	shlq	$32, %rsi
	orq	%r13, %rsi
	movq	(%r10,%r14,8), %rdi
	cmpq	%rsi, %rdi
	jl	.LBB0_49
	movq	%rsi, %rdi
	jmp	.LBB0_49
.LBB0_52:
	andl	$15, %r8d
	addq	%rsi, %rbx
	movq	%r8, %rdx
	movq	%rbx, %r14
	jmp	.LBB0_46
	.p2align	4
.LBB0_16:
	vsubsd	%xmm19, %xmm24, %xmm0
	movabsq	$.LCPI0_1, %rdx
	vmovsd	(%rdx), %xmm1
	vdivsd	%xmm0, %xmm1, %xmm0
	vmovsd	%xmm0, -40(%rsp)
	vucomisd	%xmm19, %xmm17
	jbe	.LBB0_19
.LBB0_18:
	vsubsd	%xmm19, %xmm17, %xmm0
	movabsq	$.LCPI0_1, %rdx
	vmovsd	(%rdx), %xmm1
	vdivsd	%xmm0, %xmm1, %xmm0
	vmovapd	%xmm0, 48(%rsp)
	vucomisd	%xmm17, %xmm24
	vxorpd	%xmm23, %xmm23, %xmm23
	ja	.LBB0_20
	jmp	.LBB0_21
.LBB0_1:
	movq	$0, -96(%rsp)
	movq	$0, -88(%rsp)
.LBB0_2:
	movq	728(%rsp), %rax
	movq	-96(%rsp), %rcx
	addq	%rcx, (%rax)
	movq	-88(%rsp), %rcx
	addq	%rcx, 8(%rax)
	movq	-32(%rsp), %rax
	movq	$0, (%rax)
	xorl	%eax, %eax
	addq	$72, %rsp
	popq	%rbx
	popq	%r12
	popq	%r13
	popq	%r14
	popq	%r15
	popq	%rbp
	vzeroupper
	retq
.Lfunc_end0:
	.size	_ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE, .Lfunc_end0-_ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE

	.globl	_ZN7cpython6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE
	.p2align	4
	.type	_ZN7cpython6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE,@function
_ZN7cpython6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE:
	.cfi_startproc
	pushq	%rbp
	.cfi_def_cfa_offset 16
	pushq	%r15
	.cfi_def_cfa_offset 24
	pushq	%r14
	.cfi_def_cfa_offset 32
	pushq	%r13
	.cfi_def_cfa_offset 40
	pushq	%r12
	.cfi_def_cfa_offset 48
	pushq	%rbx
	.cfi_def_cfa_offset 56
	subq	$936, %rsp
	.cfi_def_cfa_offset 992
	.cfi_offset %rbx, -56
	.cfi_offset %r12, -48
	.cfi_offset %r13, -40
	.cfi_offset %r14, -32
	.cfi_offset %r15, -24
	.cfi_offset %rbp, -16
	movq	%rsi, %rdi
	leaq	112(%rsp), %rbp
	leaq	120(%rsp), %r15
	leaq	128(%rsp), %r14
	leaq	136(%rsp), %r11
	movl	$16, %edx
	movl	$16, %ecx
	leaq	208(%rsp), %r10
	leaq	216(%rsp), %r12
	movabsq	$.const.strip_raster, %rsi
	movabsq	$PyArg_UnpackTuple, %r13
	xorl	%ebx, %ebx
	leaq	232(%rsp), %r8
	leaq	224(%rsp), %r9
	xorl	%eax, %eax
	pushq	%rbp
	.cfi_adjust_cfa_offset 8
	pushq	%r15
	.cfi_adjust_cfa_offset 8
	pushq	%r14
	.cfi_adjust_cfa_offset 8
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	176(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	192(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	208(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	224(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	240(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	256(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	272(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	leaq	288(%rsp), %r11
	pushq	%r11
	.cfi_adjust_cfa_offset 8
	pushq	%r10
	.cfi_adjust_cfa_offset 8
	pushq	%r12
	.cfi_adjust_cfa_offset 8
	callq	*%r13
	addq	$112, %rsp
	.cfi_adjust_cfa_offset -112
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 240(%rsp)
	vmovups	%ymm0, 264(%rsp)
	vmovups	%ymm0, 752(%rsp)
	vmovups	%ymm0, 776(%rsp)
	vmovups	%ymm0, 688(%rsp)
	vmovups	%ymm0, 712(%rsp)
	vmovups	%ymm0, 624(%rsp)
	vmovups	%ymm0, 648(%rsp)
	vmovups	%ymm0, 560(%rsp)
	vmovups	%ymm0, 584(%rsp)
	vmovups	%ymm0, 496(%rsp)
	vmovups	%ymm0, 520(%rsp)
	vmovups	%ymm0, 432(%rsp)
	vmovups	%ymm0, 456(%rsp)
	vmovups	%ymm0, 392(%rsp)
	vmovups	%ymm0, 368(%rsp)
	vmovups	%ymm0, 328(%rsp)
	vmovups	%ymm0, 304(%rsp)
	movq	$0, 104(%rsp)
	testl	%eax, %eax
	je	.LBB1_55
	movabsq	$_ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE, %rax
	cmpq	$0, (%rax)
	je	.LBB1_2
	movq	232(%rsp), %rdi
	vmovups	%ymm0, 880(%rsp)
	vmovups	%ymm0, 904(%rsp)
	movabsq	$numba_adapt_ndarray, %rbx
	leaq	880(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$4, 904(%rsp)
	jne	.LBB1_6
	movq	912(%rsp), %r13
	movq	224(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 816(%rsp)
	vmovups	%ymm0, 840(%rsp)
	leaq	816(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$4, 840(%rsp)
	jne	.LBB1_6
	movq	848(%rsp), %r12
	movq	856(%rsp), %r15
	movq	216(%rsp), %rdi
	movabsq	$PyNumber_Long, %rax
	callq	*%rax
	movq	%rax, %r14
	movabsq	$PyLong_AsLongLong, %rax
	movabsq	$Py_DecRef, %rbp
	testq	%r14, %r14
	je	.LBB1_10
	movq	%r14, %rdi
	movq	%rax, %rbx
	callq	*%rax
	movq	%rax, 24(%rsp)
	movq	%r14, %rdi
	movq	%rbp, %r14
	callq	*%rbp
.LBB1_12:
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	movabsq	$numba_adapt_ndarray, %rbp
	jne	.LBB1_54
	movq	%r15, 96(%rsp)
	movq	208(%rsp), %rdi
	movabsq	$PyNumber_Long, %rax
	callq	*%rax
	testq	%rax, %rax
	je	.LBB1_14
	movq	%rax, %r15
	movq	%rax, %rdi
	callq	*%rbx
	movq	%rax, 16(%rsp)
	movq	%r15, %rdi
	callq	*%r14
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	jne	.LBB1_54
.LBB1_17:
	movq	200(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 240(%rsp)
	vmovups	%ymm0, 264(%rsp)
	leaq	240(%rsp), %rsi
	vzeroupper
	callq	*%rbp
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$8, 264(%rsp)
	jne	.LBB1_6
	movq	272(%rsp), %r15
	movq	280(%rsp), %rax
	movq	%rax, 88(%rsp)
	movq	192(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 752(%rsp)
	vmovups	%ymm0, 776(%rsp)
	leaq	752(%rsp), %rsi
	vzeroupper
	callq	*%rbp
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$8, 776(%rsp)
	jne	.LBB1_6
	movq	%r12, 80(%rsp)
	movq	784(%rsp), %rax
	movq	%rax, 72(%rsp)
	movq	184(%rsp), %rdi
	movabsq	$PyNumber_Long, %rbp
	callq	*%rbp
	testq	%rax, %rax
	je	.LBB1_22
	movq	%rax, %r12
	movq	%rax, %rdi
	callq	*%rbx
	movq	%rax, 8(%rsp)
	movq	%r12, %rdi
	callq	*%r14
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	jne	.LBB1_54
.LBB1_25:
	movq	%r13, 64(%rsp)
	movq	176(%rsp), %rdi
	callq	*%rbp
	testq	%rax, %rax
	je	.LBB1_26
	movq	%rax, %r13
	movq	%rax, %rdi
	callq	*%rbx
	movq	%rax, %r12
	movq	%r13, %rdi
	movq	%r14, %r13
	callq	*%r14
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	jne	.LBB1_54
.LBB1_29:
	movq	168(%rsp), %rdi
	callq	*%rbp
	testq	%rax, %rax
	je	.LBB1_30
	movq	%rax, %rbp
	movq	%rax, %rdi
	callq	*%rbx
	movq	%rax, %r14
	movq	%rbp, %rdi
	callq	*%r13
.LBB1_32:
	movabsq	$numba_adapt_ndarray, %rbx
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	jne	.LBB1_54
	movq	160(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 688(%rsp)
	vmovups	%ymm0, 712(%rsp)
	leaq	688(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$8, 712(%rsp)
	jne	.LBB1_6
	movq	720(%rsp), %rbp
	movq	152(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 624(%rsp)
	vmovups	%ymm0, 648(%rsp)
	leaq	624(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$8, 648(%rsp)
	jne	.LBB1_6
	movq	656(%rsp), %r13
	movq	144(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 560(%rsp)
	vmovups	%ymm0, 584(%rsp)
	leaq	560(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$8, 584(%rsp)
	jne	.LBB1_6
	movq	592(%rsp), %rax
	movq	%rax, 56(%rsp)
	movq	136(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 496(%rsp)
	vmovups	%ymm0, 520(%rsp)
	leaq	496(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$4, 520(%rsp)
	jne	.LBB1_6
	movq	528(%rsp), %rax
	movq	%rax, 48(%rsp)
	movq	128(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 432(%rsp)
	vmovups	%ymm0, 456(%rsp)
	leaq	432(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$4, 456(%rsp)
	jne	.LBB1_6
	movq	%r14, 40(%rsp)
	movq	464(%rsp), %r14
	movq	120(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 368(%rsp)
	vmovups	%ymm0, 392(%rsp)
	leaq	368(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$4, 392(%rsp)
	jne	.LBB1_6
	movq	%r15, 32(%rsp)
	movq	400(%rsp), %r15
	movq	112(%rsp), %rdi
	vxorps	%xmm0, %xmm0, %xmm0
	vmovups	%ymm0, 304(%rsp)
	vmovups	%ymm0, 328(%rsp)
	leaq	304(%rsp), %rsi
	vzeroupper
	callq	*%rbx
	testl	%eax, %eax
	jne	.LBB1_6
	cmpq	$8, 328(%rsp)
	jne	.LBB1_6
	movq	336(%rsp), %rbx
	movabsq	$PyEval_SaveThread, %rax
	callq	*%rax
	movq	%rbp, %rcx
	movq	%rax, %rbp
	subq	$624, %rsp
	.cfi_adjust_cfa_offset 624
	movq	%rbx, 600(%rsp)
	movq	%r15, 544(%rsp)
	movq	%r14, 488(%rsp)
	movq	672(%rsp), %rax
	movq	%rax, 432(%rsp)
	movq	680(%rsp), %rax
	movq	%rax, 376(%rsp)
	movq	%r13, 320(%rsp)
	movq	%rcx, 264(%rsp)
	movq	664(%rsp), %rax
	movq	%rax, 224(%rsp)
	movq	%r12, 216(%rsp)
	movq	632(%rsp), %rax
	movq	%rax, 208(%rsp)
	movq	696(%rsp), %rax
	movq	%rax, 184(%rsp)
	movq	712(%rsp), %rax
	movq	%rax, 136(%rsp)
	movq	656(%rsp), %rax
	movq	%rax, 128(%rsp)
	movq	640(%rsp), %rax
	movq	%rax, 88(%rsp)
	movq	648(%rsp), %rax
	movq	%rax, 80(%rsp)
	movq	720(%rsp), %rax
	movq	%rax, 64(%rsp)
	movq	704(%rsp), %rax
	movq	%rax, 56(%rsp)
	movq	688(%rsp), %rax
	movq	%rax, (%rsp)
	movabsq	$_ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE, %rax
	leaq	728(%rsp), %rdi
	callq	*%rax
	addq	$624, %rsp
	.cfi_adjust_cfa_offset -624
	movl	%eax, %ebx
	movabsq	$PyEval_RestoreThread, %rax
	movq	%rbp, %rdi
	callq	*%rax
	testl	%ebx, %ebx
	je	.LBB1_49
	cmpl	$-2, %ebx
	jne	.LBB1_50
.LBB1_49:
	movabsq	$_Py_NoneStruct, %rbx
	movabsq	$Py_IncRef, %rax
	movq	%rbx, %rdi
	callq	*%rax
.LBB1_55:
	movq	%rbx, %rax
	addq	$936, %rsp
	.cfi_def_cfa_offset 56
	popq	%rbx
	.cfi_def_cfa_offset 48
	popq	%r12
	.cfi_def_cfa_offset 40
	popq	%r13
	.cfi_def_cfa_offset 32
	popq	%r14
	.cfi_def_cfa_offset 24
	popq	%r15
	.cfi_def_cfa_offset 16
	popq	%rbp
	.cfi_def_cfa_offset 8
	vzeroupper
	retq
.LBB1_6:
	.cfi_def_cfa_offset 992
	movabsq	$PyExc_TypeError, %rdi
	movabsq	$".const.can't unbox array from PyObject into native value.  The object maybe of a different type", %rsi
.LBB1_3:
	movabsq	$PyErr_SetString, %rax
	vzeroupper
	callq	*%rax
.LBB1_54:
	xorl	%ebx, %ebx
	jmp	.LBB1_55
.LBB1_2:
	movabsq	$PyExc_RuntimeError, %rdi
	movabsq	$".const.missing Environment: _ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE", %rsi
	jmp	.LBB1_3
.LBB1_10:
	movq	%rax, %rbx
	movq	%rbp, %r14
	movq	$0, 24(%rsp)
	jmp	.LBB1_12
.LBB1_14:
	movq	$0, 16(%rsp)
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	je	.LBB1_17
	jmp	.LBB1_54
.LBB1_22:
	movq	$0, 8(%rsp)
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	je	.LBB1_25
	jmp	.LBB1_54
.LBB1_26:
	xorl	%r12d, %r12d
	movq	%r14, %r13
	movabsq	$PyErr_Occurred, %rax
	callq	*%rax
	testq	%rax, %rax
	je	.LBB1_29
	jmp	.LBB1_54
.LBB1_30:
	xorl	%r14d, %r14d
	jmp	.LBB1_32
.LBB1_50:
	testl	%ebx, %ebx
	jg	.LBB1_56
	cmpl	$-1, %ebx
	je	.LBB1_54
	cmpl	$-3, %ebx
	jne	.LBB1_57
	movabsq	$PyExc_StopIteration, %rdi
	movabsq	$PyErr_SetNone, %rax
	callq	*%rax
	jmp	.LBB1_54
.LBB1_57:
	movabsq	$PyExc_SystemError, %rdi
	movabsq	$".const.unknown error when calling native function", %rsi
	jmp	.LBB1_3
.LBB1_56:
	movabsq	$PyErr_Clear, %rax
	callq	*%rax
.Lfunc_end1:
	.size	_ZN7cpython6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE, .Lfunc_end1-_ZN7cpython6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE
	.cfi_endproc

	.globl	cfunc._ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE
	.p2align	4
	.type	cfunc._ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE,@function
cfunc._ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE:
	.cfi_startproc
	pushq	%r14
	.cfi_def_cfa_offset 16
	pushq	%rbx
	.cfi_def_cfa_offset 24
	subq	$648, %rsp
	.cfi_def_cfa_offset 672
	.cfi_offset %rbx, -24
	.cfi_offset %r14, -16
	vmovups	712(%rsp), %xmm0
	vmovaps	736(%rsp), %xmm1
	vmovaps	784(%rsp), %xmm2
	movq	840(%rsp), %rax
	vmovaps	864(%rsp), %xmm3
	movq	880(%rsp), %rcx
	movq	920(%rsp), %rdx
	movq	976(%rsp), %rsi
	movq	1032(%rsp), %rdi
	movq	1088(%rsp), %r9
	movq	1144(%rsp), %r10
	movq	1200(%rsp), %r11
	movq	1256(%rsp), %rbx
	movq	$0, 640(%rsp)
	movq	%rbx, 600(%rsp)
	movq	%r11, 544(%rsp)
	movq	%r10, 488(%rsp)
	movq	%r9, 432(%rsp)
	movq	%rdi, 376(%rsp)
	movq	%rsi, 320(%rsp)
	movq	%rdx, 264(%rsp)
	movq	%rcx, 224(%rsp)
	vmovups	%xmm3, 208(%rsp)
	movq	%rax, 184(%rsp)
	vmovups	%xmm2, 128(%rsp)
	vmovups	%xmm1, 80(%rsp)
	vmovups	%xmm0, 56(%rsp)
	movq	%r8, (%rsp)
	movabsq	$_ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE, %rax
	leaq	640(%rsp), %rdi
	callq	*%rax
	movq	640(%rsp), %rcx
	movl	$0, 636(%rsp)
	cmpl	$-2, %eax
	je	.LBB2_6
	testl	%eax, %eax
	jne	.LBB2_2
.LBB2_6:
	movq	%rcx, %rax
	addq	$648, %rsp
	.cfi_def_cfa_offset 24
	popq	%rbx
	.cfi_def_cfa_offset 16
	popq	%r14
	.cfi_def_cfa_offset 8
	retq
.LBB2_2:
	.cfi_def_cfa_offset 672
	movq	%rcx, %r14
	movabsq	$numba_gil_ensure, %rcx
	leaq	636(%rsp), %rdi
	movl	%eax, %ebx
	callq	*%rcx
	testl	%ebx, %ebx
	jg	.LBB2_3
	movl	%ebx, %eax
	cmpl	$-1, %ebx
	je	.LBB2_5
	cmpl	$-3, %eax
	jne	.LBB2_4
	movabsq	$PyExc_StopIteration, %rdi
	movabsq	$PyErr_SetNone, %rax
	callq	*%rax
	jmp	.LBB2_5
.LBB2_4:
	movabsq	$PyExc_SystemError, %rdi
	movabsq	$".const.unknown error when calling native function.2", %rsi
	movabsq	$PyErr_SetString, %rax
	callq	*%rax
.LBB2_5:
	movabsq	$".const.<numba.core.cpu.CPUContext>", %rdi
	movabsq	$PyUnicode_FromString, %rax
	callq	*%rax
	movq	%rax, %rbx
	movabsq	$PyErr_WriteUnraisable, %rax
	movq	%rbx, %rdi
	callq	*%rax
	movabsq	$Py_DecRef, %rax
	movq	%rbx, %rdi
	callq	*%rax
	movabsq	$numba_gil_release, %rax
	leaq	636(%rsp), %rdi
	callq	*%rax
	movq	%r14, %rcx
	jmp	.LBB2_6
.LBB2_3:
	movabsq	$PyErr_Clear, %rax
	callq	*%rax
.Lfunc_end2:
	.size	cfunc._ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE, .Lfunc_end2-cfunc._ZN6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE
	.cfi_endproc

	.type	.const.strip_raster,@object
	.section	.lrodata,"al",@progbits
.const.strip_raster:
	.asciz	"strip_raster"
	.size	.const.strip_raster, 13

	.type	_ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE,@object
	.comm	_ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE,8,8
	.type	".const.missing Environment: _ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE",@object
	.p2align	4, 0x0
".const.missing Environment: _ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE":
	.asciz	"missing Environment: _ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE"
	.size	".const.missing Environment: _ZN08NumbaEnv6proto212strip_rasterB2v1B82c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1mqAYgaclsGGaAA_3d_3dE5ArrayIfLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedExx5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedExxx5ArrayIxLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIdLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIiLi1E1C7mutable7alignedE5ArrayIxLi1E1C7mutable7alignedE", 492

	.type	".const.can't unbox array from PyObject into native value.  The object maybe of a different type",@object
	.p2align	4, 0x0
".const.can't unbox array from PyObject into native value.  The object maybe of a different type":
	.asciz	"can't unbox array from PyObject into native value.  The object maybe of a different type"
	.size	".const.can't unbox array from PyObject into native value.  The object maybe of a different type", 89

	.type	".const.unknown error when calling native function",@object
	.p2align	4, 0x0
".const.unknown error when calling native function":
	.asciz	"unknown error when calling native function"
	.size	".const.unknown error when calling native function", 43

	.type	".const.unknown error when calling native function.2",@object
	.p2align	4, 0x0
".const.unknown error when calling native function.2":
	.asciz	"unknown error when calling native function"
	.size	".const.unknown error when calling native function.2", 43

	.type	".const.<numba.core.cpu.CPUContext>",@object
	.p2align	4, 0x0
".const.<numba.core.cpu.CPUContext>":
	.asciz	"<numba.core.cpu.CPUContext>"
	.size	".const.<numba.core.cpu.CPUContext>", 28

	.type	_ZN08NumbaEnv5numba7cpython8builtins6ol_int12_3clocals_3e4implB2v2B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dEx,@object
	.comm	_ZN08NumbaEnv5numba7cpython8builtins6ol_int12_3clocals_3e4implB2v2B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dEx,8,8
	.type	_ZN08NumbaEnv5numba7cpython8builtins6ol_max12_3clocals_3e4implB2v3B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIxLi2EE,@object
	.comm	_ZN08NumbaEnv5numba7cpython8builtins6ol_max12_3clocals_3e4implB2v3B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIxLi2EE,8,8
	.type	_ZN08NumbaEnv5numba7cpython8builtins6ol_min12_3clocals_3e4implB2v4B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIxLi2EE,@object
	.comm	_ZN08NumbaEnv5numba7cpython8builtins6ol_min12_3clocals_3e4implB2v4B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIxLi2EE,8,8
	.type	_ZN08NumbaEnv5numba7cpython8builtins6ol_max12_3clocals_3e4implB2v5B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIdLi2EE,@object
	.comm	_ZN08NumbaEnv5numba7cpython8builtins6ol_max12_3clocals_3e4implB2v5B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIdLi2EE,8,8
	.type	_ZN08NumbaEnv5numba7cpython8builtins6ol_min12_3clocals_3e4implB2v6B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIdLi2EE,@object
	.comm	_ZN08NumbaEnv5numba7cpython8builtins6ol_min12_3clocals_3e4implB2v6B84c8tJTIeFIjxB2IKSgI4CrvQCk0Z4yRYcWsCAgXrKFt1X1erJ_2bXklRYnJJeq1msDAxYh_2bsJmaAA_3d_3dE15StarArgUniTupleIdLi2EE,8,8
	.section	".note.GNU-stack","",@progbits
